"""What the simulator publishes, and what it says of what comes in."""

import math

import numpy as np
import pytest
from visualization_msgs.msg import Marker

from nodes.cell import Robot, offline_um, two_passes
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


def test_who_takes_the_place_of_a_listener_gets_the_film(simulator, onlooker, executor,
                                                         wait_until):  # fmt: skip
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
    for key, value in (
        ('gaps', '2'),
        ('intervals over 1.5 times the usual one', '3'),
        ('usual rate [Hz]', '250.0'),
        # Across 1 m in 45 % of 600 poses.
        ('speed [m/s]', f'{1.0 / (0.45 * 599 * 0.004):.3f}'),
        ('programmed speed [m/s]', 'unknown'),
    ):
        assert viewer.value(POSES, key) == value
    source.send_fields(MOTION.stamps_ns[-1] + 1, spraying=True, programmed_speed_m_per_s=1.2)
    wait_until(lambda: viewer.value(POSES, 'programmed speed [m/s]') == '1.200')


def test_poses_that_cannot_be_are_counted_and_change_nothing(simulated, painted, onlooker,
                                                             wait_until):  # fmt: skip
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


def test_poses_in_an_unknown_frame_are_refused_with_both_names(simulated, onlooker, wait_until):
    (node, source), viewer = simulated(), onlooker(STATS)
    source.send(MOTION, frame_id='base_link')
    wait_until(lambda: node.inputs[0].poses_refused == len(MOTION))
    # tf knows none either, where it is installed.
    wait_until(lambda: viewer.reports(POSES, 'no transforms connect', b'\x02'))
    assert "they are in frame 'base_link'" in viewer.status(POSES).message
    assert 'set part_pose and part_parent_frame' in viewer.status(POSES).message
    assert node.film.snapshot().film_um.max() == 0.0
    wait_until(lambda: viewer.shows(STATS, lambda m: m.poses_rejected == len(MOTION)))
    # Refused they were, but none is any more.
    counted = f'{len(MOTION)} poses refused for their frame'
    wait_until(lambda: viewer.reports(POSES, counted, b'\x01'), what='the error gone')


def test_two_guns_on_one_topic_are_reported(simulator, ros_context, spin, onlooker, wait_until):
    node, viewer = simulator(), onlooker()
    guns = [Robot(ros_context), Robot(ros_context)]
    spin(*guns)
    wait_until(lambda: all(g.pose_publisher.get_subscription_count() for g in guns))
    for row in range(50):
        for side, gun in zip((0.0, 0.5), guns, strict=True):
            position = MOTION.positions_m[row] + [0.0, 0.0, side]
            stamp = MOTION.stamps_ns[row] + round(4e6 * side)
            gun.send_pose(stamp, position, MOTION.quaternions_xyzw[row])
    wait_until(lambda: viewer.reports(POSES, 'steps faster than a robot', b'\x01'))
    wait_until(lambda: node.inputs[0].jumps.count > 40)


def test_poses_that_the_queue_cannot_hold_are_counted(simulated, painted):
    (node, source), motion = simulated(pose_queue_depth=10), two_passes(poses=101)
    source.send(motion, slice(0, 1))
    painted(node, 1)
    source.send(motion, slice(1, None))
    painted(node, 11)
    assert node.inputs[0].messages_lost == 90
