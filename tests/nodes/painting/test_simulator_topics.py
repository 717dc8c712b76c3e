"""What the simulator publishes, says of what comes in, and does when it is asked."""

import json
import math

import numpy as np
import pytest
import trimesh
from paint_msgs.srv import SaveFilm
from std_srvs.srv import Trigger
from visualization_msgs.msg import Marker

from nodes.cell import offline_um, parameters, two_passes
from paint_deposition.files.recordings.messages import stamp_ns
from paint_deposition.film.statistics import FIGURES, film_statistics
from paint_deposition.report.colour_scales import FILM_PALETTE

MOTION = two_passes()
POSES = 'deposition_simulator: poses'
STATS = 'thickness/stats'


def test_a_late_joiner_gets_mesh_legend_and_statistics(simulated, painted, onlooker, wait_until):
    """The statistics are those of the film."""
    target = {'target_um': 10.0, 'target_tolerance_um': 5.0}
    node, source = simulated(color_min_um=0.0, color_max_um=40.0, **target)
    source.send(MOTION)
    film = painted(node)
    node.publish()
    kinds = 'mesh', 'legend', 'field', 'cloud', 'stats'
    late = onlooker(*(f'thickness/{kind}' for kind in kinds))
    wait_until(lambda: all(map(late.newest, late.heard)), what='all five topics')
    mesh = late.newest('thickness/mesh')
    assert (mesh.type, mesh.header.frame_id) == (Marker.TRIANGLE_LIST, 'part')
    assert len(mesh.points) == len(mesh.colors) == 3 * len(node.surface.faces)
    corners = node.surface.faces.ravel()
    painted_row = int(np.argmax(film[corners]))
    expected = FILM_PALETTE[int(film[corners][painted_row] / 40.0 * 256)] / 255.0
    colour = mesh.colors[painted_row]
    assert np.allclose([colour.r, colour.g, colour.b], expected[:3], atol=1e-6)
    field = late.newest('thickness/field')
    assert field.mesh_id == node.surface.mesh_id
    assert np.array_equal(field.thickness_um, film.astype(np.float32))
    cloud = late.newest('thickness/cloud')
    values = np.frombuffer(bytes(cloud.data), np.float32).reshape(-1, 4)
    assert np.array_equal(values[:, 3], film.astype(np.float32))
    texts = [m.text for m in late.newest('thickness/legend').markers if m.text]
    assert (texts[0], texts[-1]) == ('0 µm', '40 µm')
    stats, sprayed_s = late.newest(STATS), 0.004 * (600 * (1.441 - 0.581) - 1)
    for message in (mesh, field, cloud, stats):
        assert stamp_ns(message.header) == MOTION.stamps_ns[-1]
    area = node.surface.vertex_areas_m2
    expected = film_statistics(film, area, 1.9 * sprayed_s, **target)
    for name in FIGURES:
        assert getattr(stats, name) == pytest.approx(getattr(expected, name), rel=1e-6), name
    assert (stats.poses_rejected, stats.pose_gaps) == (0, 0)


def test_who_comes_for_another_listener_gets_the_film(simulator, onlooker, executor, wait_until):
    """One leaves and another comes between two publications: their number stays the same."""
    simulator(publish_rate_hz=0.5)
    first = onlooker('thickness/field')
    wait_until(lambda: first.heard['thickness/field'], what='the field')
    executor.remove_node(first)
    first.destroy_node()
    second = onlooker('thickness/field')
    wait_until(lambda: second.heard['thickness/field'], what='the field')


def test_every_gap_in_the_stamps_is_counted_and_shown(simulated, painted, onlooker, wait_until):
    (node, source), viewer = simulated(), onlooker(STATS)
    # Two gaps of gun off, and one pose lost that only the rhythm tells.
    for rows in (slice(0, 100), slice(200, 300), slice(301, 400), slice(500, 600)):
        source.send(MOTION, rows)
    painted(node, 399)
    wait_until(lambda: viewer.shows(STATS, lambda m: m.pose_gaps == 2))
    assert viewer.newest(STATS).longest_gap_s == pytest.approx(0.404)
    wait_until(lambda: viewer.reports(POSES, '2 gaps'))
    speed = f'{1.0 / (0.45 * 599 * 0.004):.3f}'  # across 1 m in 45 % of 600 poses
    for key, value in (
        ('gaps', '2'), ('intervals over 1.5 times the usual one', '3'), ('speed [m/s]', speed),
        ('usual rate [Hz]', '250.0'), ('programmed speed [m/s]', 'unknown'),
    ):  # fmt: skip
        assert viewer.value(POSES, key) == value
    source.send_fields(MOTION.stamps_ns[-1] + 1, spraying=True, programmed_speed_m_per_s=1.2)
    wait_until(lambda: viewer.value(POSES, 'programmed speed [m/s]') == '1.200')


def test_poses_that_cannot_be_are_counted_and_no_more(simulated, painted, onlooker, wait_until):
    (node, source), viewer = simulated(), onlooker(STATS, 'atomizer/progress')
    source.send(MOTION, slice(0, 300))
    place, turn = MOTION.positions_m[300], MOTION.quaternions_xyzw[300]
    newest = MOTION.stamps_ns[299]
    for stamp, *pose in (
        (newest + 1, [math.nan, 0, 0], turn), (newest + 2, place, [math.inf, 0, 0, 0]),
        (newest + 3, place, [0, 0, 0, 0]), (newest, place, turn),
        (MOTION.stamps_ns[200], place, turn),
    ):  # fmt: skip
        source.send_pose(stamp, *pose)
    source.send(MOTION, slice(300, None))
    sent = len(MOTION) + 5
    film = painted(node, sent)
    assert np.array_equal(film, offline_um(node, MOTION))
    wait_until(lambda: viewer.shows(STATS, lambda m: m.poses_received == sent))
    assert viewer.newest(STATS).poses_rejected == 5
    wait_until(lambda: viewer.reports(POSES, 'not finite'))
    for key, value in (
        ('poses refused', '5'), ('poses that are not finite', '2'), ('repeated stamps', '1'),
        ('backward stamps', '1'),
    ):  # fmt: skip
        assert viewer.value(POSES, key) == value

    # Progress names the newest pose, and no reset lowers it.
    node.reset()

    def taken(report) -> bool:
        return (stamp_ns(report.header), report.poses_received) == (MOTION.stamps_ns[-1], sent)

    wait_until(lambda: viewer.shows('atomizer/progress', taken))
    wait_until(lambda: len(viewer.heard['atomizer/progress']) >= sent // 50)

    # Those in a frame that nobody knows, tf neither, are refused with both names.
    source.send(MOTION, frame_id='base_link')
    wait_until(lambda: node.inputs[0].refused_frames.total() == len(MOTION))
    wait_until(lambda: viewer.reports(POSES, 'no transforms connect', b'\x02'))
    assert "they are in frame 'base_link'" in viewer.status(POSES).message
    assert 'set part_pose and part_parent_frame' in viewer.status(POSES).message
    assert node.film.snapshot().film_um.max() == 0.0
    wait_until(lambda: viewer.shows(STATS, lambda m: m.poses_rejected == len(MOTION)))
    # Refused they were, but none is any more.
    counted = f'{len(MOTION)} poses refused for their frame'
    wait_until(lambda: viewer.reports(POSES, counted, b'\x01'), what='the error gone')


def test_two_guns_on_one_topic_are_reported(simulator, robot, onlooker, wait_until):
    node, viewer = simulator(), onlooker()
    guns = [robot(node), robot(node)]
    for row in range(50):
        for side, gun in zip((0.0, 0.5), guns, strict=True):
            position = MOTION.positions_m[row] + [0.0, 0.0, side]
            stamp = MOTION.stamps_ns[row] + round(4e6 * side)
            gun.send_pose(stamp, position, MOTION.quaternions_xyzw[row])
    wait_until(lambda: viewer.reports(POSES, 'steps faster than a robot', b'\x01'))
    wait_until(lambda: node.inputs[0].steps.jumps > 40)


def test_poses_that_the_queue_cannot_hold_are_counted(simulated, painted):
    (node, source), motion = simulated(pose_queue_depth=10), two_passes(poses=101)
    source.send(motion, slice(0, 1))
    painted(node, 1)
    source.send(motion, slice(1, None))
    painted(node, 11)
    assert sum(topic.lost for topic in node.inputs[0].topics) == 90


@pytest.fixture
def save(call):
    """`save(caller, name)`: the answer of a simulator that is asked to save its film."""
    service = '/deposition_simulator/save_film'
    return lambda caller, name='': call(caller, SaveFilm, service, name=name)


def test_its_display_changes_and_reset_bares_metal(simulated, painted, onlooker, call, wait_until):
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


def test_zones_count_against_their_bands(simulated, painted, onlooker, save, wait_until, tmp_path):
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
        ({'pose_queue_depth': 10}, 'the subscriptions and the pose memory are made with it'),
        ({'publish_rate_hz': 600.0}, 'out of range'),
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
