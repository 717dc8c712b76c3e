"""A player as a process: what it says at its end, and with which exit code."""

from files.recorded import straight_pass
from nodes.processes import NodeProcess
from paint_deposition.files.recordings.bags import write_pose_bag


def test_an_interrupt_ends_a_waiting_player(ros_domain, wait_until, pass_bag, tmp_path):
    with NodeProcess(tmp_path / 'player', 'bag_player', bag=pass_bag) as process:
        wait_until(lambda: 'waiting for 1 subscribers' in process.err)
        process.interrupt_as_launch_does()
        assert process.wait() == 0
        assert 'replayed 0 poses, 0 states' in process.err
        assert 'Traceback' not in process.err


def test_a_bag_that_breaks_off_later_ends_the_process(ros_domain, listen, wait_until, tmp_path):
    bag = write_pose_bag(tmp_path / 'pass', straight_pass(4_000))
    path = bag / 'pass_0.mcap'
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(content)
    listen()
    with NodeProcess(tmp_path / 'player', 'bag_player', bag=bag, rate='0.0') as process:
        wait_until(lambda: process.exit_code is not None, what='the end')
        assert process.exit_code == 2
        assert f'run: paint recover {bag}' in process.err
