"""Paint by volume and mass, transfer efficiency and wet film: what goes in must come out."""

import math
from dataclasses import replace

import numpy as np
import pytest

import scenes
from brushes import NARROW, WIDE, switched
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.film.statistics import PaintUsed, efficiency, impossible_brushes
from paint_deposition.model.eq1_pattern import Brush
from paint_deposition.motion.path_builder import spray_path
from scenes import lying_plane, stamps_ns, straight_pass

# 180 cm3/min is 3 cm3/s, 360 is 6.
ONE = Brush(number=1, planar=NARROW, flow_cm3_per_min=180.0, solids=0.5, density_g_per_cm3=1.2)
TWO = Brush(number=2, planar=WIDE, flow_cm3_per_min=360.0, solids=0.5, density_g_per_cm3=1.1)


def painted(*brushes: Brush) -> tuple[FilmIntegrator, float, float]:
    """One second of brush 1 at flow 0.5, two of brush 2: integrator, mean film, solids there."""
    motion = replace(
        straight_pass(np.arange(0.0, 4.0, 0.02), (-0.2, 0.0, 0.25), (0.2, 0.0, 0.25)),
        **switched(stamps_ns([0.5, 1.5, 3.5]), (0.5, 1), (1.0, 2), (0.0, 0)),
    )
    points = lying_plane(1.5, 101)
    film = scenes.painted(points, motion, DepositionModel.of_brushes(brushes), 'double')
    return film, float(film.film_um.mean()), float(points.area_m2 @ film.film_um)


def test_paint_is_flow_times_time_and_density():
    film, mean_um, on_part_cm3 = painted(ONE, TWO)
    used = film.used
    assert used.spraying_s == pytest.approx({1: 0.5, 2: 2.0})
    assert used.wet_cm3 == pytest.approx(3.0 * 0.5 + 6.0 * 2.0)
    assert used.mass_g == pytest.approx(1.2 * 3.0 * 0.5 + 1.1 * 6.0 * 2.0)
    assert used.solids_cm3 == pytest.approx(0.5 * used.wet_cm3)
    # All of it lands on so large a plane: what K1 says, over what was sprayed.
    laid = NARROW.K1_cm3_per_s * 0.5 + WIDE.K1_cm3_per_s * 2.0
    figures = used.figures(mean_um, on_part_cm3)
    assert figures['transfer_efficiency'] == pytest.approx(laid / (0.5 * 13.5), rel=1e-4)
    # Solids and solvent: the wet film holds the dry one.
    assert figures['mean_wet_film_um'] == pytest.approx(2.0 * mean_um)
    assert figures['spraying_time_s_by_brush'] == pytest.approx({'1': 0.5, '2': 2.0})


def test_a_brush_that_says_less_leaves_only_that_unknown():
    without = TWO.model_copy(update={'density_g_per_cm3': None})
    figures = painted(ONE, without)[0].used.figures(10.0, 1.0)
    assert figures['mass_g'] is None
    assert figures['wet_cm3'] == pytest.approx(13.5)
    unknown = painted(ONE, Brush(number=2, planar=WIDE))[0].used.figures(10.0, 1.0)
    assert unknown['wet_cm3'] is unknown['transfer_efficiency'] is None
    # A brush that does not spray need not say anything.
    third = Brush(number=3, planar=WIDE)
    assert painted(ONE, TWO, third)[0].used.wet_cm3 == pytest.approx(13.5)


def test_amounts_add_up_however_the_path_was_cut():
    path, _ = spray_path(replace(
        straight_pass(np.arange(0.0, 4.0, 0.02)),
        **switched(stamps_ns([0.5, 1.5, 3.5]), (0.5, 1), (1.0, 2), (0.0, 0)),
    ))  # fmt: skip
    model = DepositionModel.of_brushes([ONE, TWO])
    whole = PaintUsed.of(model, path)
    parts = [PaintUsed.of(model, path.select(slice(k, k + 37))) for k in range(0, len(path), 37)]
    total = sum(parts, PaintUsed())
    assert vars(total) | {'spraying_s': 0} == pytest.approx(vars(whole) | {'spraying_s': 0})
    assert total.spraying_s == pytest.approx(whole.spraying_s)


def test_more_solids_than_are_sprayed_are_told():
    """K1 is 1.3 cm3/s; 120 cm3/min at half solids are 1."""
    thin = ONE.model_copy(update={'flow_cm3_per_min': 120.0})
    assert efficiency(thin) == pytest.approx(1.3)
    (line,) = impossible_brushes(DepositionModel.of_brushes([thin, TWO]))
    assert line.startswith('brush 1 would lay 1.30 times the solids that it sprays')
    assert math.isnan(efficiency(Brush(number=2, planar=WIDE)))
    assert impossible_brushes(DepositionModel.of_brushes([Brush(number=2, planar=WIDE)])) == ()
