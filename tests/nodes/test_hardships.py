"""What a cell has to bear: a node that stalls, a folder that cannot be written, a cut network."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip('rclpy')

from paint_msgs.msg import ThicknessStats
from paint_msgs.srv import SaveFilm

from nodes.cell import Onlooker, Robot, two_passes, write_panel
from nodes.processes import NodeProcess
from nodes.recording.runs import NUMBERED, UNCOUNTED
from paint_deposition.files.recordings.bags import read_trajectory
from paint_deposition.nodes.runtime import topics

POSES = 1500
MOTION = two_passes(poses=POSES, trigger=False)
STATS = {'thickness/stats': (ThicknessStats, topics.LATCHED)}
COARSE = {'max_edge_length_m': 0.05}


@pytest.fixture
def read_only(tmp_path):
    """A folder on a file system that cannot be written, by root neither."""
    folder = tmp_path / 'read_only'
    folder.mkdir()
    mount = ['mount', '-t', 'tmpfs', '-o', 'ro,size=1m', 'tmpfs', str(folder)]
    if subprocess.run(mount, capture_output=True, check=False).returncode != 0:
        pytest.skip('a read-only file system can be mounted by root alone')
    yield folder
    subprocess.run(['umount', '-l', str(folder)], check=True)


def test_a_simulator_that_stalls_for_seconds_loses_nothing(
    ros_domain, ros_context, spin, wait_until, onlooker, tmp_path
):
    """Stopped as by a debugger or a swapping machine, while a recorder goes on beside it."""
    mesh = write_panel(tmp_path / 'panel.stl')
    robot, viewer = Robot(ros_context), onlooker(STATS)
    spin(robot)
    with (
        NodeProcess(tmp_path / 'sim', 'deposition_simulator', mesh_file=mesh, **COARSE) as sim,
        NodeProcess(
            tmp_path / 'rec', 'run_recorder', output_directory=tmp_path, name='run'
        ) as recorder,
    ):
        wait_until(lambda: robot.has_listeners(2), what='both')
        robot.send(MOTION, slice(0, 300))
        wait_until(lambda: viewer.newest('thickness/stats'), what='statistics')
        sim.stall()
        # More than a second of the middleware's own patience, less than the queues hold.
        robot.send(MOTION, slice(300, POSES))
        sim.go_on()

        def all_painted() -> bool:
            return viewer.newest('thickness/stats').poses_received == POSES

        wait_until(all_painted, what='all poses painted')
        assert viewer.newest('thickness/stats').poses_rejected == 0
        recorder.terminate()
        assert recorder.wait() == 0, recorder.err
    assert np.array_equal(read_trajectory(tmp_path / 'run').stamps_ns, MOTION.stamps_ns)


def test_a_folder_that_cannot_be_written_is_told_in_a_line(
    ros_domain, ros_context, spin, wait_until, read_only, tmp_path
):
    with NodeProcess(tmp_path / 'rec', 'run_recorder', output_directory=read_only) as recorder:
        assert recorder.wait() == 2
        (line,) = recorder.err.splitlines()
        assert line.startswith(f'error: cannot create {read_only}/run_')
        assert line.endswith('Read-only file system')
    mesh = write_panel(tmp_path / 'panel.stl')
    caller = Onlooker(ros_context, {})
    spin(caller)
    with NodeProcess(
        tmp_path / 'sim', 'deposition_simulator', mesh_file=mesh, output_directory=read_only,
        **COARSE,
    ) as sim:  # fmt: skip
        client = caller.create_client(SaveFilm, '/deposition_simulator/save_film')
        wait_until(client.service_is_ready, what='the service')
        future = client.call_async(SaveFilm.Request(name='film'))
        wait_until(future.done, what='the answer')
        assert not future.result().success
        assert 'Read-only file system' in future.result().message
        assert '\n' not in future.result().message
        sim.terminate()
        assert sim.wait() == 0, sim.err


TALKER = """
import sys, time
import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.qos import QoSProfile
from rclpy.time import Time

rclpy.init()
node = rclpy.create_node('robot')
publisher = node.create_publisher(PoseStamped, 'atomizer/pose', QoSProfile(depth=500))
while publisher.get_subscription_count() < 1:
    time.sleep(0.05)
message, begin_s = PoseStamped(), time.monotonic()
message.header.frame_id = 'part'
message.pose.orientation.w = 1.0
for number in range(int(sys.argv[1])):
    stamp_ns = 1_760_000_000_000_000_000 + number * 4_000_000
    message.header.stamp = Time(nanoseconds=stamp_ns).to_msg()
    publisher.publish(message)
    print(number, flush=True)
    time.sleep(max(0.0, begin_s + 0.004 * (number + 1) - time.monotonic()))
time.sleep(5.0)
"""


@pytest.fixture
def two_machines():
    """Two network namespaces with a cable between them; gives the commands to run in each."""
    number = os.getpid()
    first, second, ends = f'paint_a{number}', f'paint_b{number}', (f'pa{number}', f'pb{number}')
    steps = [
        f'ip netns add {first}', f'ip netns add {second}',
        f'ip link add {ends[0]} type veth peer name {ends[1]}',
        *(
            step
            for host, (name, end) in enumerate(zip((first, second), ends, strict=True), 1)
            for step in (
                f'ip link set {end} netns {name}',
                f'ip -n {name} link set lo up',
                f'ip -n {name} addr add 10.199.7.{host}/24 dev {end}',
                f'ip -n {name} link set {end} up',
            )
        ),
    ]  # fmt: skip
    try:
        for step in steps:
            done = subprocess.run(step.split(), capture_output=True, text=True, check=False)
            if done.returncode != 0:
                pytest.skip(f'network namespaces are not permitted: {step}: {done.stderr.strip()}')
        yield first, second, ends[1]
    finally:
        for name in (first, second):
            subprocess.run(['ip', 'netns', 'del', name], capture_output=True, check=False)


def test_poses_lost_on_a_cut_cable_are_counted(two_machines, ros_domain, wait_until, tmp_path):
    """The robot stands on one machine, the recorder on another; the cable is out for 10 s."""
    robot_side, recorder_side, cable = two_machines
    sent, cut = 4250, 2500
    everywhere = os.environ | {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET'}
    with (
        (tmp_path / 'rec.err').open('w+') as said,
        (tmp_path / 'robot.out').open('w+') as told,
    ):
        recorder = subprocess.Popen(
            ['ip', 'netns', 'exec', recorder_side, 'run_recorder', '--ros-args', '-p',
             f'output_directory:={tmp_path}', '-p', 'name:=run', '-p', 'topics:=[atomizer/pose]'],
            stderr=said, env=everywhere,
        )  # fmt: skip
        robot = subprocess.Popen(
            ['ip', 'netns', 'exec', robot_side, sys.executable, '-c', TALKER, str(sent)],
            stdout=told, env=everywhere,
        )  # fmt: skip

        def number() -> int:
            lines = (tmp_path / 'robot.out').read_text().split()
            return int(lines[-1]) if lines else -1

        try:
            wait_until(lambda: number() > 500, what='the first poses')
            down = ['ip', '-n', recorder_side, 'link', 'set', cable]
            subprocess.run([*down, 'down'], check=True)
            cut_at = number()
            wait_until(lambda: number() > cut_at + cut, what='ten seconds')
            subprocess.run([*down, 'up'], check=True)
            wait_until(lambda: robot.poll() is not None, what='the last pose')
            recorder.send_signal(signal.SIGINT)
            assert recorder.wait(30) == 0
        finally:
            for process in (robot, recorder):
                if process.poll() is None:
                    process.kill()
    (summary,) = (
        line for line in (tmp_path / 'rec.err').read_text().splitlines() if ' messages' in line
    )
    stamps = read_trajectory(tmp_path / 'run').stamps_ns
    inside = round((stamps[-1] - stamps[0]) / 4_000_000) + 1 - len(stamps)
    assert inside > 0
    assert f'{f", {inside} missed" if NUMBERED else UNCOUNTED}, 1 gaps' in summary
    # Recording goes on to the end. Fast DDS knows its partner for 20 s, CycloneDDS for 10 s: there
    # the two have to find each other again first.
    assert stamps[-1] == 1_760_000_000_000_000_000 + (sent - 1) * 4_000_000
    assert len(stamps) > (sent - cut - 100 if NUMBERED else 500)
