"""What was lost on the way to a recorder is counted, or it says that it cannot be."""

from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import String

from files.recorded import START_NS
from nodes.bags.runs import NUMBERED, UNCOUNTED, pose


def test_gaps_and_missed_messages_are_reported(record, publisher, onlooker, wait_until):
    recorder = record(topics=['atomizer/pose'], max_pose_gap_s=0.1)
    viewer = onlooker()
    poses = publisher(PoseStamped, 'atomizer/pose', QoSProfile(depth=500))
    stamps_ns = START_NS + np.array([0, 4, 8, 508, 512, 612, 613]) * 1_000_000
    for stamp in stamps_ns.tolist():
        poses.publish(pose(stamp))

    losses = '0 missed' if NUMBERED else 'losses cannot be counted'
    task = 'run_recorder: recording'
    # 500 ms is a gap, 100 ms is just none.
    told = f'7 messages, {losses}, 1 gaps'
    wait_until(lambda: viewer.value(task, '/atomizer/pose') == told, what='the diagnostics')
    assert all(int(viewer.value(task, key)) > 0 for key in ('bytes', 'disk free bytes'))
    recorder.close()
    words = f'7 messages{"" if NUMBERED else UNCOUNTED}, 1 gaps'
    assert recorder.summary() == f'{words}, file complete: {recorder.run.folder}'


def test_a_queue_that_overflows_shows_as_missed(record, cell, publisher, wait_until):
    """A hundred strings fit into the queue; what the middleware dropped before is counted."""
    recorder = record(topics=['chatter'])
    chatter = publisher(String, 'chatter', QoSProfile(depth=1000))
    chatter.publish(String(data='first'))
    wait_until(lambda: recorder.run.message_count == 1, what='the first message')
    # Nobody runs the recorder's callbacks meanwhile.
    for k in range(300):
        chatter.publish(String(data=str(k)))
    chatter.wait_for_all_acked()
    wait_until(lambda: recorder.run.message_count >= 101, what='what is left')
    recorder.close()
    lost = 301 - recorder.run.message_count
    assert lost > 0
    missed = f', {lost} missed' if NUMBERED else UNCOUNTED
    assert f'{recorder.run.message_count} messages{missed}' in recorder.summary()


@pytest.mark.skipif(not NUMBERED, reason='this middleware does not number messages')
def test_what_is_sent_before_its_publisher_is_heard_is_counted(record, cell, wait_until):
    """Of one robot that starts after the recorder, and of one that has long been sending."""
    sent = Counter()

    def start(gun: str) -> Callable[[], None]:
        best_effort = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
        robot = cell.create_publisher(PoseStamped, f'{gun}/atomizer/pose', best_effort)

        def send() -> None:
            robot.publish(pose(START_NS + sent[gun]))
            sent[gun] += 1

        cell.create_timer(0.005, send)
        return send

    start('old')
    wait_until(lambda: sent['old'] >= 300, what='poses that no recorder was there for')
    recorder = record(atomizers=['old', 'new'])
    sent_before, counts = sent['old'], recorder.run.counts
    wait_until(lambda: counts.get('/old/atomizer/pose', 0) >= 60, what='poses of the first')
    send = start('new')
    for _ in range(20):
        send()
    wait_until(lambda: counts.get('/new/atomizer/pose', 0) >= 60, what='poses of both')
    recorder.close()
    before_discovery = sent['new'] - counts['/new/atomizer/pose']
    assert before_discovery >= 20
    assert recorder.recorded['/new/atomizer/pose'].losses == (
        f'0 missed, {before_discovery} sent before the recorder heard their publisher'
    )
    of_old = recorder.recorded['/old/atomizer/pose'].before_discovery
    assert 0 < of_old < sent_before, 'by its rate, those since the recording began'
    assert f'{before_discovery} of /new/atomizer/pose sent before the' in recorder.summary()
