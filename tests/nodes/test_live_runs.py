"""The nodes as processes: a bag is replayed, painted and saved, as in a cell."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

pytest.importorskip('rclpy')

from paint_msgs.msg import ThicknessStats
from paint_msgs.srv import SaveFilm
from rcl_interfaces.srv import SetParameters
from std_srvs.srv import Trigger

from nodes.cell import Onlooker, parameters, two_passes, write_own_model, write_panel
from nodes.processes import NodeProcess
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.files.meshes import read_mesh
from paint_deposition.files.recordings.bags import read_trajectory, write_pose_bag
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.nodes.runtime import topics

SIMULATOR = 'deposition_simulator'
COMPARISON = 'model_comparison'
PLAYER = 'bag_player'
RECORDER = 'run_recorder'
EDGE_M = 0.03
COARSE = {'max_edge_length_m': EDGE_M}
# Several processes start one after the other, on a busy machine in half a minute each.
pytestmark = pytest.mark.timeout(600)


@pytest.fixture
def call(onlooker, call):
    """`call(type, name, request)`: the response of a service of another process."""
    return partial(call, onlooker({}))


def test_a_bag_gives_one_film_at_any_rate_live_and_offline(ros_domain, call, wait_until, tmp_path):
    mesh = write_panel(tmp_path / 'panel.stl')
    bag = write_pose_bag(tmp_path / 'motion', two_passes(poses=1000))
    simulator = NodeProcess(
        tmp_path / 'simulator',
        SIMULATOR,
        mesh_file=mesh,
        output_directory=tmp_path,
        **COARSE,
    )
    with simulator:
        for name, rate in (('fast', 0.0), ('double', 2.0)):
            with NodeProcess(
                tmp_path / name, PLAYER, bag=bag, state_topic='/atomizer/state', rate=rate
            ) as player:
                wait_until(lambda p=player: p.exit_code is not None, what=name)
                assert player.exit_code == 0, player.err
            saved = call(SaveFilm, '/deposition_simulator/save_film', SaveFilm.Request(name=name))
            assert saved.success, saved.message
            assert call(Trigger, '/deposition_simulator/reset', Trigger.Request()).success
        simulator.interrupt_as_launch_does()
        assert simulator.wait() == 0, simulator.err
    assert (tmp_path / 'fast.csv').read_bytes() == (tmp_path / 'double.csv').read_bytes()
    live = np.loadtxt(tmp_path / 'fast.csv', delimiter=',', skiprows=1)
    surface = read_mesh(mesh, 1.0, EDGE_M)
    integrator = FilmIntegrator(surface.points(), DepositionModel(), 'double')
    integrator.add(spray_path(read_trajectory(bag, None, '/atomizer/state'))[0])
    offline = integrator.film_um
    assert offline.max() > 5.0
    assert np.abs(live[:, 3] - offline).max() < 1e-6 * offline.max()


def test_a_replay_waits_for_who_is_still_loading(ros_domain, call, onlooker, wait_until, tmp_path):
    """The recorder is there at once, the simulator seconds later; both get every pose."""
    mesh = write_panel(tmp_path / 'panel.stl')
    bag = write_pose_bag(tmp_path / 'motion', two_passes(poses=300))
    statistics = onlooker({'thickness/stats': (ThicknessStats, topics.LATCHED)})
    with (
        NodeProcess(tmp_path / 'player', PLAYER, bag=bag, wait_for_subscribers=2) as player,
        NodeProcess(
            tmp_path / 'recorder', RECORDER, output_directory=tmp_path, name='run'
        ) as recorder,
        NodeProcess(tmp_path / 'simulator', SIMULATOR, mesh_file=mesh, **COARSE) as simulator,
    ):
        wait_until(lambda: player.exit_code is not None, what='the replay')
        assert player.exit_code == 0, player.err
        wait_until(
            lambda: statistics.shows('thickness/stats', lambda m: m.poses_received == 300),
            what='every pose painted',
        )
        assert call(Trigger, '/run_recorder/stop', Trigger.Request()).success
        assert recorder.wait() == 0, recorder.err
        simulator.interrupt_as_launch_does()
        assert simulator.wait() == 0, simulator.err
    assert len(read_trajectory(tmp_path / 'run')) == 300


def test_ctrl_c_while_a_film_is_saved_lets_it_be_saved(
    ros_domain, ros_context, spin, wait_until, tmp_path
):
    films = tmp_path / 'films'
    with NodeProcess(
        tmp_path / 'simulator',
        SIMULATOR,
        mesh_file=write_panel(tmp_path / 'panel.stl'),
        max_edge_length_m=0.004,
        output_directory=films,
    ) as simulator:
        caller = Onlooker(ros_context, {})
        spin(caller)
        client = caller.create_client(SaveFilm, '/deposition_simulator/save_film')
        wait_until(client.service_is_ready, what='the service')
        client.call_async(SaveFilm.Request(name='film'))
        wait_until(lambda: films.is_dir() and any(films.iterdir()), what='the first file')
        simulator.interrupt_as_launch_does()
        assert simulator.wait() == 0, simulator.err
        assert 'Traceback' not in simulator.err
    assert {path.name for path in films.iterdir()} == {'film.ply', 'film.csv', 'film.json'}


def test_ctrl_c_while_a_model_is_prepared_ends_it(ros_domain, call, tmp_path):
    """The trial of this effect would never end."""
    own = write_own_model(tmp_path)
    mesh = write_panel(tmp_path / 'panel.stl')
    with NodeProcess(
        tmp_path / 'simulator', SIMULATOR, mesh_file=mesh, allow_user_effects=True
    ) as simulator:
        changes = parameters(model_file=str(own))
        request = SetParameters.Request(parameters=[p.to_parameter_msg() for p in changes])
        answer = call(SetParameters, '/deposition_simulator/set_parameters', request)
        assert answer.results[0].successful, answer.results[0].reason
        simulator.interrupt_as_launch_does()
        assert simulator.wait() == 0, simulator.err
