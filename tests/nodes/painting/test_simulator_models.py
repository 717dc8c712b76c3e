"""Another model while the part is painted."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip('rclpy')


from nodes.cell import DIAGNOSTICS, offline_um, parameters, two_passes, write_own_model
from paint_deposition.effects.catalogue import effect_class
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ModelError
from paint_deposition.files.model_file import read_model, write_model

MOTION = two_passes()


@pytest.mark.parametrize('effect', ['incidence_attraction', 'corner_slowdown'])
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
    wait_until(lambda: not node.repainting, what='repainting')
    film = painted(node)
    assert node.film.guns[0].model == model
    assert np.array_equal(film, offline_um(node, MOTION, model))
    assert not np.array_equal(film, offline_um(node, MOTION))
    # Back to the model of before: as if it had never been another.
    assert node.set_parameters(parameters(model_file=''))[0].successful
    wait_until(lambda: not node.repainting)
    assert np.array_equal(node.film.up_to_date().film_um, offline_um(node, MOTION))


def test_poses_are_painted_while_an_effect_of_ones_own_is_tried_out(
    simulator, robot, painted, wait_until, tmp_path
):
    """Neither compiling it nor using it may hold up the executor."""
    own = write_own_model(tmp_path)
    node = simulator(allow_user_effects=True)
    source = robot(node)
    source.send(MOTION, slice(0, 300))
    painted(node, 300)
    (result,) = node.set_parameters(parameters(model_file=str(own)))
    assert result.successful, result.reason
    source.send(MOTION, slice(300, None))
    film = painted(node)
    assert node.repainting
    assert np.array_equal(film, offline_um(node, MOTION))
    (tmp_path / 'gate').touch()
    wait_until(lambda: not node.repainting, what='repainting')
    assert np.array_equal(
        node.film.up_to_date().film_um, offline_um(node, MOTION, read_model(own))
    )
    # Within 45 degrees of the axis the factor is 1.35 to 1.5.
    assert 1.2 < node.film.up_to_date().film_um.max() / film.max() <= 1.5


def test_an_effect_that_does_not_compile_is_told_and_the_old_model_goes_on(
    simulator, robot, painted, onlooker, wait_until, tmp_path
):
    own = write_own_model(tmp_path)
    code = (tmp_path / 'own.py').read_text()
    (tmp_path / 'own.py').write_text(code.replace('1.0 + gain *', "'one' + gain *"))
    node = simulator(allow_user_effects=True)
    viewer = onlooker(DIAGNOSTICS)
    robot(node).send(MOTION)
    painted(node)
    (result,) = node.set_parameters(parameters(model_file=str(own)))
    assert result.successful, result.reason
    wait_until(lambda: not node.repainting, what='the end of the trial')
    assert 'own.py: Own has a flux_factor that does not compile' in node.model_problem
    assert '\n' not in node.model_problem
    assert np.array_equal(node.film.up_to_date().film_um, offline_um(node, MOTION))
    problem = node.model_problem
    task = 'deposition_simulator: film'
    wait_until(lambda: (s := viewer.status(task)) and s.message == problem, what='diagnostics')
    # Painting again, for another reason, is done with the model that is in use.
    node.set_parameters(parameters(max_pose_gap_s=0.3))
    wait_until(lambda: not node.repainting, what='repainting')
    assert (node.model_problem, node.film.guns[0].max_pose_gap_s) == ('', 0.3)


def test_effect_files_need_leave_at_the_start_and_later(simulator, tmp_path):
    own = write_own_model(tmp_path)
    (tmp_path / 'own.py').write_text('raise SystemExit("run without leave")')
    refusal = (
        f'{own}: effect file {tmp_path}/own.py is not run, because it is Python code; if you '
        'trust it, start the node with allow_user_effects:=true'
    )
    with pytest.raises(ModelError) as refused:
        simulator(model_file=str(own))
    assert str(refused.value) == refusal
    node = simulator()
    result = node.set_parameters_atomically(parameters(model_file=str(own)))
    assert (result.successful, result.reason) == (False, refusal)
    # Nobody who can set parameters can give leave.
    both = parameters(allow_user_effects=True, model_file=str(own))
    assert not node.set_parameters_atomically(both).successful
    assert not node.get_parameter('allow_user_effects').value


def test_a_new_model_may_also_paint_from_then_on_only(simulator, robot, painted, wait_until,
                                                      tmp_path):  # fmt: skip
    thin = DepositionModel(planar={'K1_cm3_per_s': 0.19})
    write_model(tmp_path / 'thin.yaml', thin)
    node = simulator(repaint=False)
    source = robot(node)
    source.send(MOTION, slice(0, 300))
    before = painted(node, 300)
    node.set_parameters(parameters(model_file=str(tmp_path / 'thin.yaml')))
    wait_until(lambda: not node.repainting)
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
    wait_until(lambda: not node.repainting)
    assert np.array_equal(painted(node), offline_um(node, MOTION, model))


def test_a_gun_that_was_off_before_a_reset_stays_off_in_a_new_model(
    simulator, robot, painted, wait_until, tmp_path
):
    """The model is taken over after the reset and before the next pose."""
    model = DepositionModel(planar={'K1_cm3_per_s': 0.19})
    write_model(tmp_path / 'new.yaml', model)
    node = simulator()
    source = robot(node)
    motion = two_passes(trigger=False)
    source.send(motion, slice(0, 100))
    source.send_state(motion.stamps_ns[100], 0.0)
    source.send(motion, slice(100, 300))
    painted(node, 300)
    node.reset()
    assert node.set_parameters(parameters(model_file=str(tmp_path / 'new.yaml')))[0].successful
    wait_until(lambda: not node.repainting, what='the new model')
    source.send(motion, slice(300, None))
    assert painted(node, 300).max() == 0.0
    assert node.film.guns[0].model == model
