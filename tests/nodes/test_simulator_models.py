"""Another model while the part is painted."""

from __future__ import annotations

import time

import numpy as np
import pytest

pytest.importorskip('rclpy')


from nodes.cell import (
    OWN_EFFECT,
    offline_um,
    parameters,
    two_passes,
)
from paint_deposition.effects.catalogue import effect_class
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.files.model_file import read_model, write_model

MOTION = two_passes()


@pytest.mark.parametrize('effect', ['incidence_attraction', 'corner_slowdown', 'sag'])
def test_a_new_model_paints_the_motion_so_far_again(simulator, robot, painted, wait_until,
                                                    tmp_path, effect):  # fmt: skip
    model = DepositionModel().with_effect(effect_class(effect).typical())
    write_model(tmp_path / 'new.yaml', model)
    node = simulator()
    source = robot(node)
    source.send(MOTION, slice(0, 300))
    painted(node, 300)
    assert node.set_parameters(parameters(model_file=str(tmp_path / 'new.yaml')))[0].successful
    # Poses keep coming while the model is compiled.
    source.send(MOTION, slice(300, None))
    wait_until(lambda: not node.repainting, timeout_s=60.0, what='repainting')
    film = painted(node)
    assert node.film.model == model
    assert np.array_equal(film, offline_um(node, MOTION, model))
    assert not np.array_equal(film, offline_um(node, MOTION))
    # Back to the model of before: as if it had never been another.
    assert node.set_parameters(parameters(model_file=''))[0].successful
    wait_until(lambda: not node.repainting, timeout_s=60.0)
    assert np.array_equal(node.film.up_to_date().film_um, offline_um(node, MOTION))


def test_poses_are_painted_while_an_effect_of_ones_own_is_compiled(
    simulator, robot, painted, wait_until, tmp_path
):
    unique = time.time() * 1e-20  # code that no cache has seen
    (tmp_path / 'own.py').write_text(OWN_EFFECT.format(unique=unique))
    (tmp_path / 'own.yaml').write_text('effects:\n  - {file: own.py, gain: 0.5}\n')
    node = simulator()
    source = robot(node)
    source.send(MOTION, slice(0, 300))
    painted(node, 300)
    node.set_parameters(parameters(model_file=str(tmp_path / 'own.yaml')))
    source.send(MOTION, slice(300, None))
    film = painted(node)
    assert node.repainting
    assert np.array_equal(film, offline_um(node, MOTION))
    wait_until(lambda: not node.repainting, timeout_s=90.0, what='repainting')
    model = read_model(tmp_path / 'own.yaml')
    assert np.array_equal(node.film.up_to_date().film_um, offline_um(node, MOTION, model))
    # Within 45 degrees of the axis the factor is 1.35 to 1.5.
    assert 1.2 < node.film.up_to_date().film_um.max() / film.max() <= 1.5


def test_a_new_model_may_also_paint_from_then_on_only(simulator, robot, painted, wait_until,
                                                      tmp_path):  # fmt: skip
    thin = DepositionModel(planar={'K1_cm3_per_s': 0.19})
    write_model(tmp_path / 'thin.yaml', thin)
    node = simulator(repaint=False)
    source = robot(node)
    source.send(MOTION, slice(0, 300))
    before = painted(node, 300)
    node.set_parameters(parameters(model_file=str(tmp_path / 'thin.yaml')))
    wait_until(lambda: not node.repainting, timeout_s=60.0)
    source.send(MOTION, slice(300, None))
    whole = offline_um(node, MOTION)
    expected = before + 0.1 * (whole - before)
    # The state before the change had a tenth of a second that was not settled yet.
    assert np.abs(painted(node) - expected).max() < 0.05 * whole.max()


def test_a_reset_while_a_model_is_prepared_is_kept(simulator, robot, painted, wait_until,
                                                   tmp_path):  # fmt: skip
    model = DepositionModel().with_effect(effect_class('incidence_attraction').typical())
    write_model(tmp_path / 'new.yaml', model)
    node = simulator()
    source = robot(node)
    source.send(MOTION)
    painted(node)
    node.set_parameters(parameters(model_file=str(tmp_path / 'new.yaml')))
    node.reset()
    source.send(MOTION)
    wait_until(lambda: not node.repainting, timeout_s=60.0)
    assert np.array_equal(painted(node), offline_um(node, MOTION, model))
