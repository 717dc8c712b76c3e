"""Another model while the part is painted, and a model of several brushes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from paint_msgs.srv import ChangePart

import paint_deposition as pd
from brushes import switched, two_brushes
from nodes.cell import offline_um, parameters, two_passes, write_own_model
from paint_deposition.effects.catalogue import effect_class
from paint_deposition.errors import ModelError
from refusals import refusal

MOTION, SPRAYING = two_passes(), two_passes(trigger=False)
# One effect that acts on each ray, and one that needs whole strokes.
MODEL = pd.DepositionModel(
    effects=tuple(effect_class(i).typical() for i in ('incidence_attraction', 'corner_slowdown'))
)
BRUSHES = two_brushes()
POSES = 'deposition_simulator: poses'


@pytest.fixture
def set_model(tmp_path):
    """`set_model(node, model)`: set it, or its file, at run time; '' is the default one."""

    def set_model(node, model: pd.DepositionModel | Path | str) -> None:
        if isinstance(model, pd.DepositionModel):
            pd.write_model(tmp_path / 'new.yaml', model)
            model = tmp_path / 'new.yaml'
        (result,) = node.set_parameters(parameters(model_file=str(model)))
        assert result.successful, result.reason

    return set_model


def test_a_new_model_paints_the_motion_so_far_again(simulated, painted, wait_until, set_model):
    node, source = simulated()
    source.send(MOTION, slice(0, 300))
    painted(node, 300)
    set_model(node, MODEL)
    # Poses keep coming while the model is compiled.
    source.send(MOTION, slice(300, None))
    wait_until(lambda: not node.repainting, what='repainting')
    film = painted(node)
    assert node.film.guns[0].model == MODEL
    assert np.array_equal(film, offline_um(node, MOTION, MODEL))
    assert not np.array_equal(film, offline_um(node, MOTION))
    # Back to the model of before: as if it had never been another.
    set_model(node, '')
    wait_until(lambda: not node.repainting)
    assert np.array_equal(node.film.snapshot().film_um, offline_um(node, MOTION))
    # A reset while a model is prepared is kept.
    set_model(node, MODEL)
    node.reset()
    source.send(MOTION)
    wait_until(lambda: not node.repainting)
    assert np.array_equal(painted(node), offline_um(node, MOTION, MODEL))


def test_an_effect_holds_up_no_pose(
    simulated, painted, onlooker, call, wait_until, set_model, tmp_path
):
    """Neither compiling it nor using it may hold up the executor."""
    own = write_own_model(tmp_path)
    (node, source), viewer = simulated(allow_user_effects=True), onlooker()
    source.send(SPRAYING, slice(0, 300))
    painted(node, 300)
    set_model(node, own)
    source.send(SPRAYING, slice(300, None))
    film = painted(node)
    assert node.repainting
    assert np.array_equal(film, offline_um(node, SPRAYING))
    # Nor may it be used before it was tried out, on a part that comes meanwhile.
    change = '/deposition_simulator/change_part'
    assert call(viewer, ChangePart, change, serial='1').success
    source.send(SPRAYING)
    assert np.array_equal(painted(node), film)
    (tmp_path / 'gate').touch()
    wait_until(lambda: not node.repainting, what='repainting')
    painted_anew = node.film.snapshot().film_um
    assert np.array_equal(painted_anew, offline_um(node, SPRAYING, pd.read_model(own)))
    # Within 45 degrees of the axis the factor is 1.35 to 1.5.
    assert 1.2 < painted_anew.max() / film.max() <= 1.5

    # One that does not compile is told, and the old model goes on.
    code = (tmp_path / 'own.py').read_text()
    (tmp_path / 'own.py').write_text(code.replace('1.0 + gain *', "'one' + gain *"))
    set_model(node, own)
    wait_until(lambda: not node.repainting, what='the end of the trial')
    problem = node.model_problem
    assert 'own.py: Own has a flux_factor that does not compile' in problem
    assert '\n' not in problem
    assert np.array_equal(node.film.snapshot().film_um, painted_anew)
    wait_until(lambda: viewer.reports('deposition_simulator: film', problem), what='diagnostics')


def test_a_model_that_a_peer_sets_runs_and_reads_no_file(simulator, tmp_path, tmp_path_factory):
    """Files elsewhere are not opened, and a message holds nothing of those that are no models."""
    own = write_own_model(tmp_path)
    (tmp_path / 'own.py').write_text('raise SystemExit("run without leave")')
    refused = refusal(ModelError, simulator, model_file=str(own))
    assert refused == (
        f'{own}: effect file {tmp_path}/own.py is not run, because it is Python code; if you '
        'trust it, start the node with allow_user_effects:=true'
    )
    node = simulator()

    def told(**values) -> str:
        return node.set_parameters_atomically(parameters(**values)).reason

    assert told(model_file=str(own)) == refused
    # Nobody who can set parameters can give leave.
    assert told(allow_user_effects=True, model_file=str(own))
    assert not node.get_parameter('allow_user_effects').value
    elsewhere = tmp_path_factory.mktemp('elsewhere') / 'model.yaml'
    elsewhere.write_text('planar: {K2: 0.3}')
    (tmp_path / 'link.yaml').symlink_to(elsewhere)
    for file in (elsewhere, '/etc/passwd', '/dev/zero', tmp_path / 'link.yaml'):
        outside = 'is in no folder that deposition_simulator was given at its start'
        assert outside in told(model_file=str(file))
    texts = 'secret', 'a: &b secret\nb: *b', '- secret', 'K2: "secret\n', 'planar: secret' * 99
    for text in texts:
        (tmp_path / 'model.yaml').write_text(text)
        reason = told(model_file=str(tmp_path / 'model.yaml')).replace(str(tmp_path), '')
        assert 0 < len(reason) < 300
        assert 'secret' not in reason or text.startswith('planar')
    node = simulator(input_folders=[str(elsewhere.parent)])
    assert told(model_file=str(elsewhere)) == ''
    assert told(input_folders=['/'])


def test_a_new_model_may_also_paint_from_then_on_only(simulated, painted, wait_until, set_model):
    node, source = simulated(repaint=False)
    source.send(MOTION, slice(0, 300))
    before = painted(node, 300)
    set_model(node, pd.DepositionModel(planar={'K1_cm3_per_s': 0.19}))
    wait_until(lambda: not node.repainting)
    source.send(MOTION, slice(300, None))
    whole = offline_um(node, MOTION)
    expected = before + 0.1 * (whole - before)
    # The state before the change had a tenth of a second that was not settled yet.
    assert np.abs(painted(node) - expected).max() < 0.05 * whole.max()


def test_a_brush_of_no_model_is_refused(simulated, painted, onlooker, wait_until, tmp_path):
    """The paint of such a state is not painted, nor any before a state names a brush."""
    pd.write_model(tmp_path / 'brushes.yaml', BRUSHES)
    (node, source), viewer = simulated(model_file=str(tmp_path / 'brushes.yaml')), onlooker()
    source.send(SPRAYING)
    assert painted(node).max() == 0.0
    wait_until(lambda: viewer.reports(POSES, 'no state names one of the brushes yet'))
    node.reset()
    # The first pass with brush 2, the way back with 4 and, from its middle on, with 2.
    stamps = np.append(MOTION.trigger_stamps_ns, MOTION.stamps_ns[-100])
    given = (1.0, 2), (0.0, 2), (0.8, 4), (1.0, 2)
    source.send(replace(MOTION, **switched(stamps, *given)))
    film = painted(node)
    taken = switched(stamps[[0, 1, 3]], given[0], given[1], given[3])
    assert np.array_equal(film, offline_um(node, replace(MOTION, **taken), BRUSHES))
    refusal = 'brush 4 is not in the model; its brushes: 1, 2'
    assert node.inputs[0].state_errors == {refusal}
    wait_until(lambda: viewer.reports(POSES, refusal, b'\x01'), what='the refusal')
