"""What the simulator publishes, and what it says of what comes in."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip('rclpy')

from paint_msgs.msg import PoseProgress, ThicknessField, ThicknessStats
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import Marker, MarkerArray

from nodes.cell import (
    DIAGNOSTICS,
    Robot,
    offline_um,
    two_passes,
    values_of,
)
from paint_deposition.film.colour_scales import FILM_PALETTE
from paint_deposition.nodes.runtime import topics

MOTION = two_passes()
POSES = 'deposition_simulator: poses'


def test_a_late_joiner_gets_mesh_legend_and_statistics(simulator, robot, painted, onlooker,
                                                       wait_until):  # fmt: skip
    node = simulator(color_min_um=0.0, color_max_um=40.0)
    robot(node).send(MOTION)
    film = painted(node)
    node.publish()
    late = onlooker(
        {
            'thickness/mesh': (Marker, topics.LATCHED),
            'thickness/legend': (MarkerArray, topics.LATCHED),
            'thickness/stats': (ThicknessStats, topics.LATCHED),
            'thickness/field': (ThicknessField, topics.RESULTS),
            'thickness/cloud': (PointCloud2, topics.RESULTS),
        }
    )
    wait_until(lambda: all(late.heard.values()), what='all five topics')
    mesh = late.newest('thickness/mesh')
    assert (mesh.type, mesh.header.frame_id) == (Marker.TRIANGLE_LIST, 'part')
    assert len(mesh.points) == len(mesh.colors) == 3 * len(node.surface.faces)
    corners = node.surface.faces.ravel()
    painted_row = int(np.argmax(film[corners]))
    expected = FILM_PALETTE[int(film[corners][painted_row] / 40.0 * 256)] / 255.0
    colour = mesh.colors[painted_row]
    assert np.allclose([colour.r, colour.g, colour.b], expected[:3], atol=1e-6)
    field = late.newest('thickness/field')
    assert field.mesh_id == node.display.shown_as.mesh_id
    assert np.array_equal(field.thickness_um, film.astype(np.float32))
    cloud = late.newest('thickness/cloud')
    values = np.frombuffer(bytes(cloud.data), np.float32).reshape(-1, 4)
    assert np.array_equal(values[:, 3], film.astype(np.float32))
    texts = [m.text for m in late.newest('thickness/legend').markers if m.text]
    assert texts[0] == '0 µm'
    assert texts[-1] == '40 µm'
    for message in (mesh, field, cloud, late.newest('thickness/stats')):
        stamp = message.header.stamp
        assert stamp.sec * 1_000_000_000 + stamp.nanosec == MOTION.stamps_ns[-1]


def test_who_takes_the_place_of_a_listener_gets_the_film(simulator, onlooker, executor,
                                                         wait_until):  # fmt: skip
    """One leaves and another comes between two publications: their number stays the same."""
    simulator(publish_rate_hz=0.5)
    field = {'thickness/field': (ThicknessField, topics.RESULTS)}
    first = onlooker(field)
    wait_until(lambda: first.heard['thickness/field'], what='the field')
    executor.remove_node(first)
    first.destroy_node()
    second = onlooker(field)
    wait_until(lambda: second.heard['thickness/field'], what='the field')


def test_statistics_are_those_of_the_film(simulator, robot, painted, onlooker, wait_until):
    node = simulator(target_um=10.0, target_tolerance_um=5.0)
    viewer = onlooker({'thickness/stats': (ThicknessStats, topics.LATCHED)})
    robot(node).send(MOTION)
    film = painted(node)

    def newest():
        stats = viewer.newest('thickness/stats')
        return stats and stats.poses_received == len(MOTION) and stats

    wait_until(newest)
    stats, area = newest(), node.surface.vertex_areas_m2
    coated = film > 1.0
    assert stats.mean_um == pytest.approx(np.average(film[coated], weights=area[coated]))
    assert stats.max_um == film.max()
    assert stats.coverage == pytest.approx(area[coated].sum() / area.sum())
    good = coated & (np.abs(film - 10.0) <= 5.0)
    assert stats.within_target == pytest.approx(area[good].sum() / area[coated].sum())
    assert stats.painted_volume_cm3 == pytest.approx(film @ area)
    sprayed_s = 0.004 * 600 * (0.441 - 0.02 + 1.0 - 0.561) - 0.004
    assert stats.capture_fraction == pytest.approx(film @ area / (1.9 * sprayed_s), rel=1e-6)
    assert (stats.poses_rejected, stats.pose_gaps) == (0, 0)


def test_every_gap_in_the_stamps_is_counted_and_shown(simulator, robot, painted, onlooker,
                                                      wait_until):  # fmt: skip
    node = simulator()
    viewer = onlooker({'thickness/stats': (ThicknessStats, topics.LATCHED)} | DIAGNOSTICS)
    source = robot(node)
    # Two gaps of gun off, and one pose lost that only the rhythm tells.
    for rows in (slice(0, 100), slice(200, 300), slice(301, 400), slice(500, 600)):
        source.send(MOTION, rows)
    painted(node, 399)

    def shown():
        stats, status = viewer.newest('thickness/stats'), viewer.status(POSES)
        return stats and stats.pose_gaps == 2 and status and '2 gaps' in status.message

    wait_until(shown)
    assert viewer.newest('thickness/stats').longest_gap_s == pytest.approx(0.404)
    values = values_of(viewer.status(POSES))
    assert values['gaps'] == '2'
    assert values['intervals over 1.5 times the usual one'] == '3'
    assert values['usual rate [Hz]'] == '250.0'
    # Across 1 m in 45 % of 600 poses.
    assert values['speed [m/s]'] == f'{1.0 / (0.45 * 599 * 0.004):.3f}'
    assert values['programmed speed [m/s]'] == 'unknown'
    stamp_ns = MOTION.stamps_ns[-1] + 1
    source.send_fields(stamp_ns, spraying=True, programmed_speed_m_per_s=1.2)

    def programmed() -> str:
        return values_of(viewer.status(POSES))['programmed speed [m/s]']

    wait_until(lambda: programmed() == '1.200', what='the programmed speed')


def test_poses_that_cannot_be_are_counted_and_change_nothing(simulator, robot, painted, onlooker,
                                                             wait_until):  # fmt: skip
    node = simulator()
    viewer = onlooker({'thickness/stats': (ThicknessStats, topics.LATCHED)} | DIAGNOSTICS)
    source = robot(node)
    source.send(MOTION, slice(0, 300))
    good = MOTION.positions_m[300], MOTION.quaternions_xyzw[300]
    source.send_pose(MOTION.stamps_ns[299] + 1, [math.nan, 0, 0], good[1])
    source.send_pose(MOTION.stamps_ns[299] + 2, good[0], [math.inf, 0, 0, 0])
    source.send_pose(MOTION.stamps_ns[299] + 3, good[0], [0, 0, 0, 0])
    source.send_pose(MOTION.stamps_ns[299], *good)
    source.send_pose(MOTION.stamps_ns[200], *good)
    source.send(MOTION, slice(300, None))
    film = painted(node, len(MOTION) + 5)
    assert np.array_equal(film, offline_um(node, MOTION))

    def shown():
        stats, status = viewer.newest('thickness/stats'), viewer.status(POSES)
        done = stats and stats.poses_received == len(MOTION) + 5
        return done and status and 'not finite' in status.message

    wait_until(shown)
    assert viewer.newest('thickness/stats').poses_rejected == 5
    values = values_of(viewer.status(POSES))
    assert values['poses refused'] == '5'
    assert values['poses that are not finite'] == '2'
    assert values['repeated stamps'] == '1'
    assert values['backward stamps'] == '1'


def test_poses_in_an_unknown_frame_are_refused_with_both_names(simulator, robot, onlooker,
                                                               wait_until):  # fmt: skip
    node = simulator()
    viewer = onlooker({'thickness/stats': (ThicknessStats, topics.LATCHED)} | DIAGNOSTICS)
    robot(node).send(MOTION, frame_id='base_link')
    wait_until(lambda: node.inputs[0].poses_refused == len(MOTION))

    def shown():
        status = viewer.status(POSES)
        return status and 'refused' in status.message

    wait_until(shown)
    status = viewer.status(POSES)
    assert status.level == b'\x02'
    assert "'base_link'" in status.message
    # tf knows none either, where it is installed.
    assert 'no transform between them' in status.message
    assert 'set part_pose and part_parent_frame' in status.message
    assert node.film.up_to_date().film_um.max() == 0.0
    wait_until(lambda: viewer.shows('thickness/stats', lambda m: m.poses_rejected == len(MOTION)))
    # Refused they were, but none is any more.
    counted = f'{len(MOTION)} poses refused for their frame'
    wait_until(lambda: counted in viewer.status(POSES).message, what='the error gone')
    assert viewer.status(POSES).level == b'\x01'


def test_a_pose_in_the_parent_frame_is_transformed(simulator, robot, painted):
    # The part hangs turned by 90 degrees about z, a metre along the cell's x.
    turned = [1.0, 0.0, 0.5, 0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)]
    node = simulator(part_pose=turned, part_parent_frame='base_link')
    source = robot(node)
    x, y, z = MOTION.positions_m.T
    in_cell = np.stack([1.0 - y, x, 0.5 + z], axis=1)
    qx, qy, qz, qw = MOTION.quaternions_xyzw.T
    c = math.sqrt(0.5)
    quaternions = c * np.stack([qx - qy, qy + qx, qz + qw, qw - qz], axis=1)
    for changed_ns, flow in zip(MOTION.trigger_stamps_ns, MOTION.trigger_flow, strict=True):
        source.send_state(changed_ns, flow)
    for stamp, position, quaternion in zip(MOTION.stamps_ns, in_cell, quaternions, strict=True):
        source.send_pose(stamp, position, quaternion, '/base_link')
    film, expected = painted(node), offline_um(node, MOTION)
    assert np.abs(film - expected).max() < 1e-5 * expected.max()
    assert node.inputs[0].poses_refused == 0


def test_progress_names_the_newest_pose_and_no_reset_lowers_it(simulator, robot, painted, onlooker,
                                                               wait_until):  # fmt: skip
    node = simulator()
    player = onlooker({'atomizer/progress': (PoseProgress, topics.PROGRESS)})
    wait_until(lambda: player.newest('atomizer/progress'))
    assert player.newest('atomizer/progress').header.stamp.sec == 0
    robot(node).send(MOTION)
    painted(node)
    node.reset()

    def taken():
        report = player.newest('atomizer/progress')
        stamp_ns = report.header.stamp.sec * 10**9 + report.header.stamp.nanosec
        return stamp_ns == MOTION.stamps_ns[-1] and report.poses_received == len(MOTION)

    wait_until(taken)
    wait_until(lambda: len(player.heard['atomizer/progress']) >= len(MOTION) // 50)


def test_two_guns_on_one_topic_are_told(simulator, ros_context, spin, onlooker, wait_until):
    node = simulator()
    viewer = onlooker(DIAGNOSTICS)
    guns = [Robot(ros_context), Robot(ros_context)]
    spin(*guns)
    wait_until(lambda: all(g.pose_publisher.get_subscription_count() for g in guns))
    for row in range(50):
        for side, gun in zip((0.0, 0.5), guns, strict=True):
            position = MOTION.positions_m[row] + [0.0, 0.0, side]
            stamp_ns = MOTION.stamps_ns[row] + round(4e6 * side)
            gun.send_pose(stamp_ns, position, MOTION.quaternions_xyzw[row])

    def status():
        found = viewer.status(POSES)
        return found and 'steps faster than a robot' in found.message and found

    wait_until(lambda: status() and node.inputs[0].jumps.count > 40)
    assert status().level == b'\x01'
