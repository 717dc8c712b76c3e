"""Brushes named by the states of a running cell."""

from dataclasses import replace

import numpy as np
import pytest

from brushes import switched, two_brushes
from nodes.cell import offline_um, parameters, two_passes
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.files.model_file import write_model
from paint_deposition.model.eq1_pattern import Brush

MODEL = two_brushes()
PLAIN = two_passes()
STAMPS = [*PLAIN.trigger_stamps_ns, PLAIN.stamps_ns[-100]]
# The first pass with brush 2, the way back with brush 1 and, from its middle on, with 2.
MOTION = replace(PLAIN, **switched(STAMPS, (1.0, 2), (0.0, 2), (0.8, 1), (1.0, 2)))
POSES = 'deposition_simulator: poses'


@pytest.fixture
def node(simulator, tmp_path):
    write_model(tmp_path / 'brushes.yaml', MODEL)
    return simulator(model_file=str(tmp_path / 'brushes.yaml'))


def test_a_brush_that_is_not_in_the_model_is_refused_and_those_it_has_are_named(
    node, robot, painted, onlooker, wait_until, tmp_path
):
    """In a state, whose paint is not painted; and in use, by a new model without it."""
    viewer = onlooker()
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
    assert node.inputs[0].state_errors == {refusal}
    wait_until(lambda: viewer.reports(POSES, refusal, b'\x01'), what='the refusal')
    other = DepositionModel.of_brushes([Brush(number=1, planar=MODEL.planar)])
    write_model(tmp_path / 'other.yaml', other)
    assert node.set_parameters(parameters(model_file=str(tmp_path / 'other.yaml')))[0].successful
    wait_until(lambda: not node.repainting, what='the end of the trial')
    assert 'brush 2 is not in the model; its brushes: 1' in node.model_problem
    assert np.array_equal(node.film.snapshot().film_um, film)


def test_without_a_state_nothing_says_which_brush_sprays(node, robot, painted, onlooker,
                                                         wait_until):  # fmt: skip
    viewer = onlooker()
    robot(node).send(two_passes(trigger=False))
    assert painted(node).max() == 0.0
    told = 'no state names one of the brushes yet'
    wait_until(lambda: viewer.reports(POSES, told), what='the warning')
