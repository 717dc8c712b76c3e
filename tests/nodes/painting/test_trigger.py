"""What the gun's states do to the film while it is painted."""

from dataclasses import replace

import numpy as np
import rclpy
from paint_msgs.msg import AtomizerState
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Bool

from nodes.cell import offline_um, two_passes
from paint_deposition.nodes.topics import header

POSES = 'deposition_simulator: poses'
UNTRIGGERED = two_passes(trigger=False)


def test_a_state_of_which_only_spraying_is_filled_sprays(simulated, painted, onlooker, wait_until):
    """Poses that stop meanwhile are reported, until it is closed."""
    (node, source), viewer = simulated(), onlooker()
    source.send_fields(UNTRIGGERED.stamps_ns[0], spraying=True)
    source.send(UNTRIGGERED)
    film = painted(node)
    assert film.max() > 5.0
    assert np.array_equal(film, offline_um(node, UNTRIGGERED))
    silent = 'the gun sprays, and no pose has come for'
    wait_until(lambda: viewer.reports(POSES, silent, b'\x01'))
    source.send_state(UNTRIGGERED.stamps_ns[-1], 0.0)
    wait_until(lambda: viewer.reports(POSES, 'waiting for poses', b'\x00'))
    # It says that it sprays, and that no paint flows.
    source.send_fields(UNTRIGGERED.stamps_ns[-1] + 1, spraying=True, flow=0.0)
    wait_until(lambda: viewer.reports(POSES, '1 states that spray with flow 0', b'\x01'))


def test_a_latched_trigger_counts(simulator, robot, ros_context, spin, wait_until, painted):
    """The gun was closed before; beside it a robot sends by best effort and keeps nothing."""
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    gun = Node('gun', context=ros_context)
    states = gun.create_publisher(AtomizerState, 'atomizer/state', latched)
    before_ns = int(UNTRIGGERED.stamps_ns[0]) - 60_000_000_000
    states.publish(AtomizerState(header=header('', before_ns)))
    source = robot(reliable=False)
    spin(gun)
    node = simulator()
    wait_until(lambda: source.has_subscribers(1), what='discovery')
    wait_until(lambda: node.film.guns[0].flow == 0.0, what='the latched state')
    for count in range(1, 61):  # one by one, or the middleware may drop some
        source.send(UNTRIGGERED, slice(99 + count, 100 + count))
        film = painted(node, count)
    assert film.max() == 0.0
    for publisher, flow in ((states, 0.5), (source.state_publisher, 0.25)):
        at = header('', int(UNTRIGGERED.stamps_ns[159]))
        publisher.publish(AtomizerState(header=at, spraying=True, flow=flow))
        wait_until(lambda flow=flow: node.film.guns[0].flow == flow, what='the next state')


def test_a_state_counts_behind_all_poses_sent_before_it(simulated, painted):
    """In one burst, in which the clock is set back by half a second at pose 300."""
    node, source = simulated()
    back = 500_000_000 * (np.arange(len(UNTRIGGERED)) >= 300)
    rows, flow = np.array([0, 320, 400]), np.array([1.0, 0.0, 1.0])
    stepped = replace(UNTRIGGERED, stamps_ns=UNTRIGGERED.stamps_ns - back)
    for row in range(len(stepped)):
        if row in rows:
            source.send_state(stepped.stamps_ns[row], float(flow[rows == row][0]))
        source.send(stepped, slice(row, row + 1))
    motion = replace(stepped, trigger_stamps_ns=stepped.stamps_ns[rows], trigger_flow=flow)
    motion = replace(motion, trigger_rows=rows)
    assert np.array_equal(painted(node), offline_um(node, motion))


def test_what_leaves_the_part_bare_is_reported(simulated, onlooker, wait_until):
    """A gun by another clock, and one that sprays beside the part."""
    (node, source), viewer = simulated(), onlooker()
    motion = two_passes(poses=900, trigger=False)
    source.send_state(motion.stamps_ns[0] + 5_000_000_000, 1.0)
    wait_until(lambda: node.inputs[0].spraying, what='the state')
    source.send(motion, slice(0, 50))
    ahead = '1 states stamped over 1 s ahead of the poses sent after them: set the clocks'
    wait_until(lambda: viewer.reports(POSES, ahead, b'\x01'))
    source.send_state(motion.stamps_ns[50], 1.0)
    aside = replace(motion, positions_m=motion.positions_m + np.array([2.0, 0.0, 0.0]))
    source.send(aside, slice(50, None))
    bare = 'cm3 were sprayed and nothing lands on the part: check part_pose'
    wait_until(lambda: viewer.reports(POSES.replace('poses', 'part'), bare, b'\x01'))


def test_robots_are_heard_as_they_send(simulator, robot, painted, wait_until, still):
    """A best-effort robot beside a reliable one, of which no pose may be lost for that."""
    node = simulator(pose_queue_depth=5000)
    first = robot(node)
    first.send(UNTRIGGERED, slice(0, 300))
    assert np.ptp(painted(node, 300)) > 0.0
    second = robot(reliable=False)
    wait_until(lambda: second.pose_publisher.get_subscription_count(), what='best effort')
    second.send(UNTRIGGERED, slice(300, 310))
    wait_until(lambda: node.film.counts.received > 300, what='poses of best effort')
    hears = lambda: [s for s in node.subscriptions if s.topic_name == '/atomizer/pose']  # noqa: E731
    qualities = [ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT]
    assert [each.qos_profile.reliability for each in hears()] == qualities
    second.destroy_node()
    # Poses go on while it leaves, and each of them counts once.
    row = 310
    while len(hears()) > 1:
        first.send(UNTRIGGERED, slice(row, row + 1))
        row += row < 599
        still(0.01)
    first.send(UNTRIGGERED, slice(row, 600))
    assert 310 < row < 599
    wait_until(lambda: node.film.counts.received == 600, what='all poses')
    assert node.film.counts.rejected == sum(topic.lost for topic in node.inputs[0].topics) == 0


def test_no_more_is_asked_for(simulator, robot, onlooker, wait_until, capfd):
    """Of a best-effort robot that is there: neither side reports that the other does not fit."""
    source = robot(reliable=False)
    node, viewer = simulator(), onlooker()
    wait_until(lambda: source.is_subscribed_by(node))
    wait_until(lambda: viewer.reports(POSES, 'waiting for poses', b'\x00'))
    said = capfd.readouterr().err
    assert 'ready' in said
    assert not {'[WARN]', '[ERROR]'} & set(said.split())


def test_a_bool_as_the_state_is_an_error(simulator, onlooker, ros_domain, wait_until, capfd):
    """It cannot be heard, and the gun would count as always on."""
    guns = ['left', 'right']
    simulator(atomizers=guns)
    viewer, apart = onlooker(), Context()  # one participant has one type for a topic
    rclpy.init(context=apart, domain_id=ros_domain)
    controller = Node('plc', context=apart)
    for gun in guns:
        controller.create_publisher(Bool, f'{gun}/atomizer/state', 10)
        told = f'{gun}/atomizer/state comes as std_msgs/msg/Bool and does not switch the gun'
        task = f'deposition_simulator: {gun}/poses'
        wait_until(lambda name=task, said=told: viewer.reports(name, said, b'\x02'), what=told)
        assert capfd.readouterr().err.count(told) == 1
    controller.destroy_node()
    apart.try_shutdown()


def test_what_a_peer_names_takes_no_memory(simulated, onlooker, wait_until):
    (node, source), viewer = simulated(), onlooker()
    place = UNTRIGGERED.positions_m[0], UNTRIGGERED.quaternions_xyzw[0]
    for k in range(40):
        source.send_pose(UNTRIGGERED.stamps_ns[k], *place, f'{k}' + 'a' * 100_000)
        source.send_fields(UNTRIGGERED.stamps_ns[k], spraying=True, flow=-1.0 - k)
    wait_until(lambda: viewer.reports(POSES, '40 poses refused', b'\x02'))
    wait_until(lambda: node.inputs[0].anomalies['states refused'] == 40)
    kept = [*node.inputs[0].refused_frames, *node.inputs[0].state_errors]
    assert sum(map(len, kept)) < 10_000
    assert len(viewer.status(POSES).message) < 10_000
