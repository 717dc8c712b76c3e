"""Effects whose amplitudes follow a set-point of the brushes by a power."""

from dataclasses import replace

import numpy as np
import pytest

from brushes import NARROW, WIDE, switched
from paint_deposition.effects.base import Effect, SetPointPower
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.learned.curves import CURVES
from paint_deposition.effects.library.air_drift import AirDrift
from paint_deposition.effects.library.incidence_attraction import IncidenceAttraction
from paint_deposition.effects.library.sag import Sag
from paint_deposition.errors import ModelError
from paint_deposition.files.model_file import read_model, write_model
from paint_deposition.files.provenance import model_digest
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.inference.fitting.parameters import FreeParameters
from paint_deposition.model.brush import Brush
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.path_builder import spray_path
from scenes import lying_plane, painted, stamps_ns, weaving

SET_POINTS = {1: (70.0, 200.0), 2: (50.0, 320.0)}
CHARGE = SetPointPower(setting='voltage_kv', at=70.0, exponent=2.0)
AIR = SetPointPower(setting='shaping_air_l_per_min', at=250.0, exponent=-1.0)
MORE_AIR = SetPointPower(setting='shaping_air_l_per_min', at=100.0, exponent=1.0)
BELL = SetPointPower(setting='bell_speed_rpm', at=4e4, exponent=1.0)
FOLLOWING = (
    IncidenceAttraction(attraction=2.0, follows=(CHARGE,)),
    AirDrift(shift_down_m=0.03, shift_across_m=0.01, follows=(AIR,)),
)
CHANGES = switched(
    stamps_ns([0.2, 1.3, 1.75, 2.2, 2.7, 3.3]),
    (1.0, 1), (0.7, 2), (0.0, 2), (0.8, 2), (1.2, 1), (0.0, 1),
)  # fmt: skip
MOTION = replace(weaving(np.arange(0.0, 4.0, 0.01)), **CHANGES)


PATH, _ = spray_path(MOTION, 0.25, 0.1 * NARROW.sigma1_m)


def brushed(*effects: Effect) -> DepositionModel:
    return DepositionModel.of_brushes(
        (
            Brush(number=n, planar=planar, voltage_kv=kv, shaping_air_l_per_min=air)
            for (n, (kv, air)), planar in zip(SET_POINTS.items(), (NARROW, WIDE), strict=True)
        ),
        effects=effects,
    )


def film_um(model: DepositionModel, path: SprayPath) -> np.ndarray:
    return painted(lying_plane(), path, model, 'double').film_um


def amplitudes(number: int) -> tuple[Effect, ...]:
    """By hand, at the set-points of a brush."""
    kv, air = SET_POINTS[number]
    charge, drift = (kv / 70.0) ** 2, 250.0 / air
    return (
        IncidenceAttraction(attraction=2.0 * charge),
        AirDrift(shift_down_m=0.03 * drift, shift_across_m=0.01 * drift),
    )


def test_each_brush_paints_with_the_effects_at_its_own_set_points():
    """On the flux and on the path: the film is that of the brushes apart, each effect by hand."""
    total = np.zeros(len(lying_plane()))
    for number in SET_POINTS:
        own = PATH.select(PATH.brush == number)
        total += film_um(brushed(*amplitudes(number)).painting_with(number), own)
    together = film_um(brushed(*FOLLOWING), PATH)
    np.testing.assert_allclose(together, total, rtol=1e-9)
    # What one amplitude for both would be off by.
    plain = film_um(brushed(*(e.model_copy(update={'follows': ()}) for e in FOLLOWING)), PATH)
    assert np.abs(together - plain).max() > 0.02 * total.max()


def test_a_fit_varies_the_amplitude_and_keeps_the_power():
    model = brushed(*FOLLOWING)
    parameters = FreeParameters.of(model, *model.effects)
    assert 'incidence_attraction.attraction' in parameters.names
    assert len(parameters.of_effects) == 3
    vector = parameters.encode(model)
    vector[-3] += 0.5
    found = parameters.decode(vector)
    assert found.effect('incidence_attraction').follows == (CHARGE,)
    assert found.effect('incidence_attraction').attraction == pytest.approx(2.5)


def test_a_model_file_holds_what_an_effect_follows(tmp_path):
    model = brushed(*FOLLOWING)
    write_model(tmp_path / 'model.yaml', model)
    again = read_model(tmp_path / 'model.yaml')
    assert again == model
    assert model_digest(again) == model_digest(model)
    plain = brushed(IncidenceAttraction(attraction=2.0))
    write_model(tmp_path / 'plain.yaml', plain)
    assert 'follows' not in (tmp_path / 'plain.yaml').read_text()


@pytest.mark.parametrize(
    ('model', 'words'),
    [
        (DepositionModel(effects=FOLLOWING[:1]),
         'incidence_attraction follows set-points, which a model with planar alone does not have'),
        (brushed(IncidenceAttraction(attraction=1.0, follows=(BELL,))),
         'incidence_attraction follows a set-point, and brush 1 has no bell_speed_rpm'),
        (brushed(Sag(run_m=0.01, follows=(AIR,))),
         'sag acts on the finished film, which all brushes share: it cannot follow set-points'),
        (brushed(CURVES['time_s'](low=0.0, high=4.0, learned=(0.1, -0.1), follows=(AIR,))),
         'learned:time_s has no amplitude that could follow set-points'),
        (brushed(AirDrift(shift_down_m=0.09, follows=(MORE_AIR,))),
         'air_drift: shift_down_m would be 0.18 at the set-points of brush 1, outside 0 to 0.1'),
    ],
)  # fmt: skip
def test_what_cannot_follow_is_refused(model, words, tmp_path):
    write_model(tmp_path / 'model.yaml', model)
    with pytest.raises(ModelError, match=words):
        read_model(tmp_path / 'model.yaml')
    with pytest.raises(ModelError, match=words):
        FilmIntegrator(lying_plane(), model)
