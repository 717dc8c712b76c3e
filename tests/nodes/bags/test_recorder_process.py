"""A recorder as a process: killed, told to end, its folder taken away."""

import contextlib
import itertools
import shutil

from geometry_msgs.msg import PoseStamped
from rclpy.qos import QoSProfile
from rosbags.rosbag2 import Reader

from files.recorded import START_NS
from nodes.bags.runs import pose
from nodes.processes import recorder_process
from paint_deposition.errors import RecordingError
from paint_deposition.files.motion_files import read_recording
from paint_deposition.files.recordings.mcap_recovery import recover


def test_a_run_that_is_taken_away_ends_the_recorder(ros_domain, wait_until, tmp_path):
    run = tmp_path / 'run'
    with recorder_process(tmp_path) as process:
        wait_until(lambda: 'recording' in process.err, what='the recording')
        shutil.rmtree(run)
        assert process.wait() == 2
        assert f'error: {run}/run_0.mcap: No such file or directory' in process.err
        assert 'Traceback' not in process.err


def test_a_killed_recorder_keeps_what_came_a_moment_before(
    ros_domain, publisher, wait_until, tmp_path
):
    """A hundred poses do not fill a chunk: the recorder closes it by its age."""
    with recorder_process(tmp_path, topics='[/pose]') as process:
        poses = publisher(PoseStamped, '/pose', QoSProfile(depth=100))
        for number in range(100):
            poses.publish(pose(START_NS + number * 4_000_000))

        def on_disk() -> int:
            # One chunk of poses that came within half a second, or several.
            with contextlib.suppress(RecordingError):
                recovery = recover(tmp_path / 'run', tmp_path / f'tried_{next(attempts)}')
                return recovery.message_count
            return 0

        attempts = itertools.count()
        wait_until(lambda: on_disk() == 100, what='all poses on disk')
        process.kill()
    assert not (tmp_path / 'run/metadata.yaml').exists()
    recovery = recover(tmp_path / 'run', tmp_path / 'recovered')
    assert recovery.counts == {'/pose': 100}
    assert len(read_recording(tmp_path / 'recovered')) == 100
    with Reader(tmp_path / 'recovered') as reader:
        (connection,) = reader.connections
        assert connection.digest.startswith('RIHS01_')
        assert connection.ext.offered_qos_profiles[0].reliability.name == 'RELIABLE'
