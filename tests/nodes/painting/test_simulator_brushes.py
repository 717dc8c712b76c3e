"""Brushes named by the states of a running cell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip('rclpy')

from brushes import switched, two_brushes
from nodes.cell import DIAGNOSTICS, offline_um, parameters, two_passes, values_of
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.files.model_file import write_model
from paint_deposition.model.brush import Brush

MODEL = two_brushes()
PLAIN = two_passes()
# The first pass with brush 2, the way back with brush 1 and, from its middle on, with 2.
MOTION = replace(
    PLAIN,
    **switched(
        [*PLAIN.trigger_stamps_ns, PLAIN.stamps_ns[-100]], (1.0, 2), (0.0, 2), (0.8, 1), (1.0, 2)
    ),
)
POSES = 'deposition_simulator: poses'


@pytest.fixture
def model_file(tmp_path) -> str:
    write_model(tmp_path / 'brushes.yaml', MODEL)
    return str(tmp_path / 'brushes.yaml')


def test_the_live_film_of_two_brushes_is_the_offline_film(simulator, robot, painted, onlooker,
                                                          wait_until, model_file):  # fmt: skip
    node = simulator(model_file=model_file)
    viewer = onlooker(DIAGNOSTICS)
    robot(node).send(MOTION)
    film = painted(node)
    assert np.array_equal(film, offline_um(node, MOTION, MODEL))
    assert film.max() > 1.0

    def gun():
        status = viewer.status(POSES)
        return status and values_of(status)['gun']

    wait_until(lambda: gun() == 'spraying, flow 1, brush 2', what='the brush in the diagnostics')


def test_a_state_of_an_unknown_brush_is_refused_and_the_known_ones_are_named(
    simulator, robot, painted, onlooker, wait_until, model_file
):
    """What it would have painted is not: the gun stays as it was."""
    node = simulator(model_file=model_file)
    viewer = onlooker(DIAGNOSTICS)
    wrong = np.where(MOTION.trigger_brush == 1, 4, MOTION.trigger_brush)
    robot(node).send(replace(MOTION, trigger_brush=wrong))
    film = painted(node)
    left = MOTION.trigger_brush != 1
    taken = switched(
        MOTION.trigger_stamps_ns[left],
        *zip(MOTION.trigger_flow[left], MOTION.trigger_brush[left], strict=True),
    )
    assert np.array_equal(film, offline_um(node, replace(MOTION, **taken), MODEL))
    refusal = 'brush 4 is not in the model; its brushes: 1, 2'
    assert node.inputs[0].refusals_of_states == {refusal}
    wait_until(lambda: (s := viewer.status(POSES)) and refusal in s.message, what='the refusal')
    assert viewer.status(POSES).level == b'\x01'


def test_without_a_state_nothing_says_which_brush_sprays(simulator, robot, painted, onlooker,
                                                         wait_until, model_file):  # fmt: skip
    node = simulator(model_file=model_file)
    viewer = onlooker(DIAGNOSTICS)
    robot(node).send(replace(PLAIN, trigger_stamps_ns=np.empty(0, np.int64),
                             trigger_flow=np.empty(0)))  # fmt: skip
    assert painted(node).max() == 0.0
    told = 'no state names one of the brushes yet'
    wait_until(lambda: (s := viewer.status(POSES)) and told in s.message, what='the warning')


def test_a_new_model_without_a_brush_in_use_is_not_taken(simulator, robot, painted, wait_until,
                                                         model_file, tmp_path):  # fmt: skip
    node = simulator(model_file=model_file)
    robot(node).send(MOTION)
    film = painted(node)
    other = DepositionModel.of_brushes([Brush(number=1, planar=MODEL.planar)])
    write_model(tmp_path / 'other.yaml', other)
    assert node.set_parameters(parameters(model_file=str(tmp_path / 'other.yaml')))[0].successful
    wait_until(lambda: not node.repainting, what='the end of the trial')
    assert 'brush 2 is not in the model; its brushes: 1' in node.model_problem
    assert np.array_equal(node.film.up_to_date().film_um, film)


def between(*set_points: tuple[float, ...]):
    """The two passes, whose states name no brush and tell these set-points one after the other."""
    stamps = [*PLAIN.trigger_stamps_ns, PLAIN.stamps_ns[-100]]
    told = switched(stamps, (1.0, 0), (0.0, 0), (0.8, 0), (1.0, 0))
    return replace(PLAIN, **told, trigger_set_points=np.array(set_points))


MIDDLE, NEARER = (280.0, 0.0, 41_000.0, 0.0), (220.0, 0.0, 47_500.0, 0.0)
CLOSED, TOO_FAST = (0.0,) * 4, (280.0, 0.0, 52_000.0, 0.0)


def test_live_set_points_paint_between_brushes_as_offline(simulator, robot, painted, onlooker,
                                                          wait_until, model_file):  # fmt: skip
    node = simulator(model_file=model_file)
    viewer = onlooker(DIAGNOSTICS)
    motion = between(MIDDLE, CLOSED, NEARER, MIDDLE)
    robot(node).send(motion)
    film = painted(node)
    assert np.array_equal(film, offline_um(node, motion, MODEL))
    assert film.max() > 1.0
    wait_until(
        lambda: (
            (s := viewer.status(POSES))
            and values_of(s)['gun'] == 'spraying, flow 1, brush between those calibrated'
        ),
        what='the brush between in the diagnostics',
    )
