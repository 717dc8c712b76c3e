"""Services and parameters of the simulator."""

import json
import math

import numpy as np
import pytest
import trimesh
from paint_msgs.srv import SaveFilm
from std_srvs.srv import Trigger

from nodes.cell import parameters, two_passes

MOTION = two_passes()


@pytest.fixture
def save(call):
    """`save(caller, name)`: the answer of a simulator that is asked to save its film."""
    service = '/deposition_simulator/save_film'
    return lambda caller, name='': call(caller, SaveFilm, service, name=name)


def test_its_display_changes_at_run_time_and_reset_bares_the_metal(
    simulated, painted, onlooker, call, wait_until
):
    node, source = simulated()
    viewer = onlooker('thickness/field', 'thickness/stats', 'thickness/legend')
    source.send(MOTION)
    first = painted(node)
    changes = parameters(color_max_um=25.0, target_um=10.0, target_tolerance_um=9.9)
    assert all(result.successful for result in node.set_parameters(changes))
    wait_until(lambda: viewer.shows('thickness/stats', lambda m: m.within_target == 1.0))
    wait_until(lambda: viewer.shows('thickness/legend', lambda m: m.markers[-1].text == '25 µm'))
    wait_until(lambda: viewer.heard['thickness/field'])
    answer = call(viewer, Trigger, '/deposition_simulator/reset')
    assert answer.success
    assert '600 poses' in answer.message
    wait_until(lambda: viewer.shows('thickness/field', lambda m: max(m.thickness_um) == 0.0))
    assert node.film.counts.received == 0
    source.send(MOTION)
    assert np.array_equal(painted(node), first)
    assert node.set_parameters(parameters(publish_rate_hz=1.0))[0].successful
    assert node.show_timer.timer_period_ns == 1_000_000_000


def test_the_film_is_saved_whole_and_never_over_another(simulated, painted, save, tmp_path):
    node, source = simulated()
    source.send(MOTION)
    film = painted(node)
    answer = save(source, 'door_7')
    assert answer.success, answer.message
    folder = tmp_path / 'films'
    written = [folder / f'door_7.{kind}' for kind in ('ply', 'csv', 'json')]
    assert list(answer.paths) == list(map(str, written))
    table = np.genfromtxt(folder / 'door_7.csv', delimiter=',', names=True)
    assert np.allclose(table['thickness_um'], film, rtol=1e-8, atol=1e-30)
    mesh = trimesh.load_mesh(folder / 'door_7.ply', process=False)
    assert np.array_equal(mesh.faces, node.surface.faces)
    figures = json.loads((folder / 'door_7.json').read_text())
    assert figures['mesh_id'] == node.surface.mesh_id
    assert figures['poses']['received'] == len(MOTION)
    again = save(source, 'door_7')
    assert not again.success
    assert 'door_7.ply is there already' in again.message
    assert list(again.paths) == []
    for name in ('../up', 'a/b', '.hidden', 'a b', '-rf', 'x' * 300):
        refused = save(source, name)
        assert f"name '{name[:40]}" in refused.message
        assert ': use at most 200 letters, digits' in refused.message
    # A folder that cannot be written is told in a line.
    node.values['output_directory'] = '/dev/null/films'
    refused = save(source, 'film')
    assert not refused.success
    assert '/dev/null/films' in refused.message
    assert '\n' not in refused.message
    node.values['output_directory'] = str(folder)
    assert save(source).success
    assert len(list(folder.iterdir())) == 6


def test_zones_are_counted_against_their_own_bands(
    simulated, painted, onlooker, save, wait_until, tmp_path
):
    zones, viewer = tmp_path / 'zones.yaml', onlooker('thickness/stats')
    zones.write_text(
        'zones: [{name: left, target_um: 9, tolerance_um: 3, box: [[-9, -9, -9], [0, 9, 9]]}]'
    )
    node, source = simulated(zones_file=str(zones), target_um=5.0, target_tolerance_um=1.0)
    source.send(MOTION)
    film, x, area = painted(node), node.surface.vertices_m[:, 0], node.surface.vertex_areas_m2
    good = np.where(x <= 0.0, np.abs(film - 9.0) <= 3.0, np.abs(film - 5.0) <= 1.0)
    share = area[good & (film > 1.0)].sum() / area[film > 1.0].sum()
    counted = lambda stats: abs(stats.within_target - share) < 1e-6  # noqa: E731
    wait_until(lambda: viewer.shows('thickness/stats', counted))
    assert save(source, 'film').success
    figures = json.loads((tmp_path / 'films/film.json').read_text())
    (left,) = figures['zones']
    assert (left['name'], left['target_um']) == ('left', 9.0)
    assert left['max_um'] == film[x <= 0.0].max()
    assert (tmp_path / 'films/film.csv').read_text().startswith('x_m,y_m,z_m,thickness_um,zone\n')


def test_changes_that_cannot_be_are_refused_with_the_reason(simulator):
    node = simulator()
    for values, reason in (
        ({'mesh_file': 'other.stl'}, 'cannot change while the node is configured: the film so'),
        ({'max_edge_length_m': 0.01}, 'the film so far lies on this mesh'),
        ({'frame_id': 'other'}, 'in this frame'),
        ({'pose_queue_depth': 10}, 'the subscriptions and the pose memory are made with it'),
        ({'publish_rate_hz': 600.0}, 'out of range'),
        ({'max_pose_gap_s': 0.5}, 'the subscriptions and the pose memory are made with it'),
        ({'trigger_latency_s': math.nan}, 'out of range'),
        ({'color_min_um': 50.0}, 'color_min_um 50 is not below color_max_um 0'),
        ({'target_um': 20.0, 'target_tolerance_um': 60.0}, 'tolerance_um 60 is not less than tar'),
        ({'model_file': 'none.yaml'}, 'none.yaml: no such file'),
        ({'part_pose': [0.0, 1.0], 'part_parent_frame': 'cell'}, 'seven numbers'),
        ({'part_pose': [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]}, 'without part_parent_frame'),
    ):
        before = {name: node.get_parameter(name).value for name in values}
        result = node.set_parameters_atomically(parameters(**values))
        assert not result.successful
        assert reason in result.reason
        assert '\n' not in result.reason
        assert {name: node.get_parameter(name).value for name in values} == before
