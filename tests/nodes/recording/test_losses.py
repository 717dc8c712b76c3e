"""What was lost on the way to a recorder is counted, or it says that it cannot be."""

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.qos import QoSProfile
from std_msgs.msg import String

from files.recorded import START_NS
from nodes.recording.runs import NUMBERED, UNCOUNTED, pose


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
