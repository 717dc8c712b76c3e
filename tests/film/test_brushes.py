"""Brushes: each lays its own paint, and together they lay the sum."""

import contextlib
from dataclasses import replace

import numpy as np
import pytest

from brushes import NARROW, WIDE, switched, two_brushes
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.library.pose_lag import PoseLag
from paint_deposition.errors import ModelError
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.film.layout import term_weights
from paint_deposition.film.live_film import LiveFilm, without_refused_states
from paint_deposition.film.statistics import PaintUsed
from paint_deposition.model.eq1_pattern import Brush
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.motion.pose_stream import TriggerChange
from scenes import events, lying_plane, painted, stamps_ns, straight_pass, weaving

MODEL = two_brushes()
TIMES_S = np.arange(0.0, 4.0, 0.004)
# Closed at first; from brush 1 straight to brush 2; a state that is repeated; off in between.
CHANGES = switched(
    stamps_ns([0.2, 0.5013, 1.3, 1.7502, 2.0, 2.2, 2.7, 3.3]),
    (0.0, 7), (1.0, 1), (0.7, 2), (0.0, 2), (0.0, 1), (0.8, 2), (0.8, 2), (1.2, 1),
)  # fmt: skip


def test_two_brushes_on_one_part_lay_the_sum_of_their_films():
    motion, points = replace(weaving(TIMES_S), **CHANGES), lying_plane()
    both, apart = painted(points, motion, MODEL, precision='double'), []
    for number, planar in ((1, NARROW), (2, WIDE)):
        flow = np.where(motion.trigger_brush == number, motion.trigger_flow, 0.0)
        alone, model = replace(motion, trigger_flow=flow), DepositionModel(planar=planar)
        apart.append(painted(points, alone, model, precision='double'))
    total = sum(one.film_um for one in apart)
    # Sub-steps are not cut where both sides of a change are without paint.
    assert np.abs(both.film_um - total).max() < 2e-4 * total.max()
    assert both.used.emitted_cm3 == pytest.approx(
        sum(one.used.emitted_cm3 for one in apart), rel=1e-12
    )
    assert min(one.film_um.max() for one in apart) > 1.0


@pytest.mark.parametrize('number', [0, 5])
def test_one_brush_is_its_pattern_to_the_last_bit(number):
    brush = {'trigger_brush': np.where(CHANGES['trigger_flow'] > 0.0, number, 0)}
    motion, model = replace(weaving(TIMES_S), **CHANGES | brush), DepositionModel()
    unnamed = replace(motion, trigger_brush=np.empty(0, np.int64))
    plain = painted(lying_plane(), unnamed, model).film_um
    # A cell that numbers its only brush needs no other model.
    for one in (DepositionModel(brushes=[Brush(number=5, planar=model.planar)]), model):
        assert np.array_equal(painted(lying_plane(), motion, one).film_um, plain)


@pytest.mark.parametrize('lag_s', [0.03, -0.03])
def test_a_lag_takes_the_brush_along(lag_s):
    stamps = stamps_ns([0.5, 1.5, 2.5, 3.0])
    changes = switched(stamps, (1.0, 2), (0.0, 2), (1.0, 1), (0.0, 0))
    motion = straight_pass(TIMES_S, **changes)
    model = MODEL.with_effect(PoseLag(lag_s=lag_s))
    path, _ = spray_path(motion, 0.25, model.max_step_m, model.needs_whole_strokes)
    sprayed, _ = FilmIntegrator(lying_plane(), model).sprayed(path)
    assert PaintUsed.of(model, sprayed).spraying_s == pytest.approx({1: 0.5, 2: 1.0}, rel=1e-9)


def test_terms_are_kept_apart_by_brush_and_brushes_are_in_order_each_once():
    path, _ = spray_path(replace(weaving(TIMES_S), **CHANGES))
    film = FilmIntegrator(lying_plane(), MODEL, 'double', parallel=False)
    terms = film.terms(film.steps(path))
    weights = np.concatenate([term_weights(planar)[0] for planar in MODEL.patterns])
    film.add(path)
    assert np.abs(weights @ terms - film.film_um).max() < 1e-9 * film.film_um.max()
    one, two = MODEL.brushes
    assert DepositionModel(brushes=(two, one)) == MODEL
    assert MODEL.planar == NARROW
    with pytest.raises(ValueError, match='the same number'):
        DepositionModel(brushes=(one, one))


def test_an_unknown_brush_is_refused_and_the_known_ones_are_named():
    motion = replace(weaving(TIMES_S), **switched(stamps_ns([0.5]), (1.0, 3)), source='run')
    with pytest.raises(ModelError, match=r'^run: brush 3 is not in the model; its brushes: 1, 2$'):
        without_refused_states(motion, MODEL)
    film = LiveFilm(lying_plane(), MODEL)
    film.add_trigger(TriggerChange(int(stamps_ns(0.1)), 1.0, 2))
    with pytest.raises(ModelError, match=r'^brush 3 is not in the model; its brushes: 1, 2$'):
        film.add_trigger(TriggerChange(int(stamps_ns(0.5)), 1.0, 3))
    with pytest.raises(ModelError, match=r'^no brush is named; its brushes: 1, 2$'):
        film.add_trigger(TriggerChange(int(stamps_ns(0.5)), 1.0))
    film.add_trigger(TriggerChange(int(stamps_ns(0.6)), 0.0, 3))
    assert [event.brush for event in film.log.events()] == [2, 3]


@pytest.mark.parametrize(
    ('model', 'others', 'warning'),
    [
        (MODEL, ((1.0, 7), (0.5, 2)), '2 states left out: brush 7 is not in the model'),
        (DepositionModel(), ((1.0, 1),), '4 states left out: brushes 1, 2 are used and the model'),
    ],
)
def test_states_that_a_model_refuses_are_left_out_as_by_a_live_film(model, others, warning):
    """Of one pattern without a number the first brush is the only one."""
    told = [(1.0, 1) if len(model.brushes) else (0.4, 1), *others, (1.0, 2), (0.8, 7), (0.0, 2),
            (1.0, 2), (1.0, 1), (0.6, 2), (0.7, 2)]  # fmt: skip
    changes = switched(stamps_ns(0.2 + 0.3 * np.arange(len(told))), *told)
    motion = replace(weaving(TIMES_S), **changes, source='run')
    film = LiveFilm(lying_plane(), model)
    for event in events(motion, 20):
        with contextlib.suppress(ModelError):
            film.replay([event])
    taken = without_refused_states(motion, model)
    assert np.array_equal(film.snapshot().film_um, painted(lying_plane(), taken, model).film_um)
    assert taken.warnings[0].startswith(f'run: {warning}')
    with pytest.raises(ModelError, match=r'^run: brush'):
        without_refused_states(motion, model, strict=True)
