"""Set-points instead of a brush's number: patterns between calibrated brushes, live as offline."""

from dataclasses import replace

import numpy as np
import pytest

from brushes import SET_POINTS, switched, two_brushes
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ModelError
from paint_deposition.files.provenance import model_digest
from paint_deposition.files.recordings.bags import read_trajectory, write_pose_bag
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.film.interpolated_brushes import with_interpolated_brushes
from paint_deposition.film.live_film import LiveFilm
from paint_deposition.model.brush import BETWEEN, MOST_BETWEEN, Brush, BrushLaw, SetPoints
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.motion.pose_stream import PoseBatch, TriggerChange
from paint_deposition.motion.trajectory import Trajectory
from scenes import changes_of, events, lying_plane, painted, stamps_ns, weaving

MODEL = two_brushes()
MIDDLE, NEARER = (280.0, 0.0, 41_000.0, 0.0), (220.0, 0.0, 47_500.0, 0.0)
AT_FIRST = (200.0, 0.0, 50_000.0, 0.0)
OUTSIDE = (280.0, 0.0, 52_000.0, 0.0)
UNTOLD = (0.0, 0.0, 0.0, 0.0)
TIMES_S = np.arange(0.0, 4.0, 0.01)


def motion(*changes: tuple[float, int, tuple[float, ...]]) -> Trajectory:
    """A weaving motion whose gun takes these flows, brushes and set-points one after the other."""
    stamps = stamps_ns(np.linspace(0.2, 3.4, len(changes)))
    told = switched(stamps, *(change[:2] for change in changes))
    set_points = np.array([change[2] for change in changes])
    return replace(weaving(TIMES_S), **told, trigger_set_points=set_points)


def offline_um(given: Trajectory, model: DepositionModel = MODEL) -> np.ndarray:
    numbered, known = with_interpolated_brushes(given, model)
    known.require_brushes(numbered.brushes)
    return painted(lying_plane(), numbered, known).film_um


CHANGING = motion(
    (1.0, 0, MIDDLE), (0.7, 0, NEARER), (0.0, 0, UNTOLD), (1.0, 2, MIDDLE), (1.0, 0, MIDDLE),
    (0.0, 0, UNTOLD),
)  # fmt: skip


def test_set_points_paint_as_a_brush_that_is_interpolated_at_them():
    flow, _, bell, _ = MIDDLE
    at = SetPoints(flow_cm3_per_min=flow, bell_speed_rpm=bell)
    third = Brush(
        number=3, planar=BrushLaw(MODEL.brushes).pattern('brushes, 3', at), interpolated=True,
        **at.model_dump(),
    )  # fmt: skip
    by_number = motion((1.0, 3, UNTOLD), (0.0, 0, UNTOLD))
    expected = offline_um(by_number, DepositionModel.of_brushes([*MODEL.brushes, third]))
    found = offline_um(motion((1.0, 0, MIDDLE), (0.0, 0, UNTOLD)))
    assert np.array_equal(found, expected)
    assert found.max() > 1.0


def test_the_live_film_between_brushes_is_the_offline_film_to_the_last_bit():
    film = LiveFilm(lying_plane(), MODEL)
    for event in events(CHANGING, 10):
        film.replay([event])
    assert np.array_equal(film.snapshot().film_um, offline_um(CHANGING))


def test_a_film_that_another_model_goes_on_with_keeps_the_set_points():
    """As after a new model file: the motion so far is another model's, the rest the new one's."""
    film = LiveFilm(lying_plane(), MODEL)
    film.replay(events(motion((1.0, 0, MIDDLE)), 10))
    wider = MODEL.with_patterns(
        p.model_copy(update={'K1_cm3_per_s': 2.0 * p.K1_cm3_per_s}) for p in MODEL.patterns
    )
    before = film.snapshot().film_um
    film.switch_model(wider)
    later = weaving(TIMES_S + 4.0)
    film.add_poses(PoseBatch(later.stamps_ns, later.positions_m, later.quaternions_xyzw))
    assert film.brush >= BETWEEN
    assert film.model.brushes[-1].planar.K1_cm3_per_s > 1.9 * MODEL.planar.K1_cm3_per_s
    assert film.snapshot().film_um.sum() > 2.5 * before.sum()


@pytest.mark.parametrize(('told', 'number'), [((0, AT_FIRST), 1), ((2, OUTSIDE), 2)])
def test_a_number_or_the_set_points_of_a_calibrated_brush_are_that_brush(told, number):
    """To the last bit; a number counts more than set-points beside it."""
    by_number = offline_um(motion((1.0, number, UNTOLD), (0.0, 0, UNTOLD)))
    assert np.array_equal(offline_um(motion((1.0, *told), (0.0, 0, UNTOLD))), by_number)


@pytest.mark.parametrize(
    ('set_points', 'words'),
    [
        (OUTSIDE, 'set-points of the atomizer: bell_speed_rpm is 52000, outside 30000 to 50000'),
        ((0.0, 0.0, 41_000.0, 0.0), 'flow_cm3_per_min is missing, in which brushes 1, 2 differ'),
        ((280.0, 0.0, 41_000.0, 60.0), 'voltage_kv is given and brush 1 has none'),
        (UNTOLD, 'no brush is named; its brushes: 1, 2'),
    ],
)
def test_set_points_that_no_brush_lies_at_are_refused_live_and_offline(set_points, words):
    with pytest.raises(ModelError, match=words):
        offline_um(motion((1.0, 0, set_points)))
    film = LiveFilm(lying_plane(), MODEL)
    first, second = changes_of(motion((1.0, 0, MIDDLE), (1.0, 0, set_points)))
    film.add_trigger(first)
    with pytest.raises(ModelError, match=words):
        film.add_trigger(second)
    assert [change.set_points for change in film.log.events()] == [MIDDLE]


def test_set_points_that_change_without_end_are_refused():
    film, stamps = LiveFilm(lying_plane(), MODEL), stamps_ns(np.arange(MOST_BETWEEN + 1.0))
    *fine, last = [
        TriggerChange(int(stamp), 1.0, 0, (210.0 + 0.1 * k, 0.0, 41_000.0, 0.0))
        for k, stamp in enumerate(stamps)
    ]
    for change in fine:
        film.add_trigger(change)
    with pytest.raises(ModelError, match='give what is set, not what is measured'):
        film.add_trigger(last)


def test_a_bag_keeps_set_points_and_paint_tells_them_apart(tmp_path):
    read = read_trajectory(write_pose_bag(tmp_path / 'run', CHANGING), None, '/atomizer/state')
    assert np.array_equal(np.nan_to_num(read.trigger_set_points), CHANGING.trigger_set_points)
    assert np.array_equal(offline_um(read), offline_um(CHANGING))
    numbered, known = with_interpolated_brushes(read, MODEL)
    assert numbered.notes[-1].endswith('set-points lie between brushes 1, 2 (2 different)')
    assert model_digest(known) == model_digest(MODEL)
    path, _ = spray_path(numbered)
    integrator = FilmIntegrator(lying_plane(), known)
    integrator.add(path)
    used = integrator.used.figures(1.0, 1.0)
    assert set(used['spraying_time_s_by_brush']) == {'2', 'between'}
    wet = sum(
        (path.flow * path.dwell_s)[path.brush == brush.number].sum()
        * brush.flow_cm3_per_min / 60.0
        for brush in known.brushes
    )  # fmt: skip
    assert used['wet_cm3'] == pytest.approx(wet)
    assert used['solids_cm3'] == pytest.approx(wet * SET_POINTS[1]['solids'])
