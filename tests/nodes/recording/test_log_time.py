"""A recording whose clock is set back is read in the order in which it was made."""

import numpy as np
import pytest

pytest.importorskip('rclpy')

from files.recorded import START_NS, Messages, straight_pass
from paint_deposition.files.recordings.bags import POSE_TYPE, read_trajectory
from paint_deposition.files.recordings.mcap_run import RunTopic, RunWriter
from paint_deposition.files.recordings.message_definitions import standard
from paint_deposition.nodes.recording.recorded_topic import LogTime

HOUR_NS = 3_600_000_000_000


def test_times_that_only_go_on_stay_as_they_are():
    log_time = LogTime()
    times = [5, 7, 6, 9, HOUR_NS]  # two topics, a little out of order; then a long pause
    assert [log_time.of(START_NS + time) - START_NS for time in times] == times
    assert log_time.set_back_ns == 0


def test_a_topic_that_waited_longer_than_others_is_no_step_back():
    """On a busy machine its messages are taken seconds after those of the others."""
    log_time = LogTime()
    seconds = 1_000_000_000
    taken = [('/stats', 9), ('/pose', 2), ('/pose', 3), ('/stats', 10), ('/pose', 4)]
    found = [log_time.of(START_NS + at * seconds, topic) for topic, at in taken]
    assert found == [START_NS + at * seconds for _, at in taken]
    assert log_time.set_back_ns == 0


def test_after_a_step_back_time_goes_on_at_its_pace():
    log_time = LogTime()
    log_time.of(START_NS)
    found = [log_time.of(START_NS - HOUR_NS + time) for time in (0, 4, 8)]
    assert found == [START_NS, START_NS + 4, START_NS + 8]
    assert log_time.set_back_ns == HOUR_NS
    assert log_time.of(START_NS - 2 * HOUR_NS) == START_NS + 8


def test_the_poses_of_such_a_run_come_in_their_order(tmp_path):
    motion, messages, log_time = straight_pass(50), Messages(), LogTime()
    with RunWriter(tmp_path / 'run') as run:
        run.add_topic(RunTopic('/pose', POSE_TYPE, standard(POSE_TYPE)))
        poses = zip(motion.stamps_ns, motion.positions_m, motion.quaternions_xyzw, strict=True)
        for row, (stamp, *pose) in enumerate(poses):
            received = int(stamp) - (HOUR_NS if row >= 25 else 0)
            cdr = bytes(messages.serialised(messages.pose(stamp, *pose)))
            run.write('/pose', cdr, log_time.of(received), received)
    assert np.array_equal(read_trajectory(tmp_path / 'run').stamps_ns, motion.stamps_ns)
