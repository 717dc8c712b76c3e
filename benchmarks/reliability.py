"""Nodes that are told to end, or killed, at random moments from their start on.

Simulator, recorder and player are started beside a robot that sends 250 poses a second, and end by
SIGINT or SIGTERM, once or twice, or by SIGKILL, after a random time. What must hold then:

* told to end: exit code 0 within ten seconds, no traceback, no half-written file; a recorder that
  had begun its run has completed it. More time may be allowed on a machine that is busy with other
  work: what is being imported ends first. In the first tenths of a second, before any code of the
  node runs, the signal ends Python itself; these ends are counted apart, and leave nothing behind;
* killed: the run can be recovered up to a second before the end, without a hole.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np
import trimesh

from paint_deposition.errors import PaintError
from paint_deposition.files.motion_files import read_recording
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.files.recordings.mcap_recovery import recover
from paint_deposition.motion.trajectory import Trajectory

RATE_HZ = 250
LONGEST_S = 4.0
WAYS = {
    'SIGINT once': (signal.SIGINT,),
    'SIGINT twice': (signal.SIGINT, signal.SIGINT),
    'SIGTERM once': (signal.SIGTERM,),
    'SIGTERM twice': (signal.SIGTERM, signal.SIGTERM),
    'SIGKILL': (signal.SIGKILL,),
}
EARLY = 'while Python started'
# What Python says, with exit code 1, when a signal comes before it is whole.
NO_SITE = 'Failed to import the site module'
NODES = ('run_recorder', 'deposition_simulator', 'bag_player')
ALONE = {'OPENBLAS_NUM_THREADS': '1', 'NUMBA_NUM_THREADS': '1'}


@dataclass(frozen=True)
class Trial:
    """One end of one node; ``problem`` is '' where all held, or EARLY."""

    node: str
    way: str
    after_s: float
    took_s: float
    problem: str


@click.command()
@click.option('--times', default=50, show_default=True, help='Trials of each node.')
@click.option('--seed', default=1, show_default=True)
@click.option('--nodes', default=','.join(NODES), show_default=True)
@click.option('--within', default=10.0, show_default=True, help='Longest time to end [s].')
def main(times: int, seed: int, nodes: str, within: float) -> None:
    """End each node so many times, the ways in turn; ends with 1 where something did not hold."""
    rng = np.random.default_rng(seed)
    trials = []
    with tempfile.TemporaryDirectory() as place, robot():
        mesh, bag = _part(Path(place)), _motion(Path(place))
        for node in nodes.split(','):
            for number in range(times):
                way = [*WAYS][number % len(WAYS)]
                folder = Path(place) / f'{node}_{number}'
                after_s = rng.uniform(0.0, LONGEST_S)
                trials.append(_trial(node, way, after_s, within, folder, mesh, bag))
                if trials[-1].problem not in ('', EARLY):
                    print(trials[-1], flush=True)
    failed = [trial for trial in trials if trial.problem not in ('', EARLY)]
    held = Counter(f'{t.node}, {t.problem or t.way}' for t in trials if t.problem in ('', EARLY))
    slowest_s = max(trial.took_s for trial in trials)
    told = {'trials': len(trials), 'failed': len(failed), 'slowest_s': slowest_s, 'held': held}
    print(json.dumps(told, indent=2))
    sys.exit(1 if failed else 0)


def _part(folder: Path) -> Path:
    corners = [[-0.4, 0, -0.4], [0.4, 0, -0.4], [0.4, 0, 0.4], [-0.4, 0, 0.4]]
    trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False).export(folder / 'panel.stl')
    return folder / 'panel.stl'


def _motion(folder: Path) -> Path:
    stamps = 1_760_000_000_000_000_000 + 4_000_000 * np.arange(2500)
    positions = np.stack([np.linspace(-0.5, 0.5, 2500), np.full(2500, -0.25), np.zeros(2500)], 1)
    quaternions = np.tile([-(0.5**0.5), 0.0, 0.0, 0.5**0.5], (2500, 1))
    motion = Trajectory(stamps, positions, quaternions, 'part')
    return write_pose_bag(folder / 'motion', motion)


def _trial(
    node: str, way: str, after_s: float, within_s: float, folder: Path, mesh: Path, bag: Path
) -> Trial:
    folder.mkdir()
    parameters = {
        'run_recorder': {'output_directory': folder, 'name': 'run', 'topics': '[atomizer/pose]'},
        'deposition_simulator': {
            'mesh_file': mesh, 'max_edge_length_m': 0.05, 'output_directory': folder,
        },
        'bag_player': {'bag': bag, 'rate': 1.0, 'wait_for_subscribers': 0},
    }[node]  # fmt: skip
    # The player speaks in a namespace of its own: its poses are not the robot's.
    remap = ['-r', '__ns:=/replay'] if node == 'bag_player' else []
    given = [part for key, value in parameters.items() for part in ('-p', f'{key}:={value}')]
    process = subprocess.Popen(
        [node, '--ros-args', *given, *remap],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=os.environ | ALONE,
    )  # fmt: skip
    time.sleep(after_s)
    told_s = time.monotonic()
    for number in WAYS[way]:
        process.send_signal(number)
    try:
        said, _ = process.communicate(timeout=within_s)
        problem = _problem(way, process.returncode, said, folder)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        problem = f'still there after {within_s:g} s'
    took_s = time.monotonic() - told_s
    return Trial(node, way, round(after_s, 3), round(took_s, 3), problem)


def _problem(way: str, exit_code: int, said: str, folder: Path) -> str:
    """What did not hold, '' if nothing."""
    ended_python = exit_code in (-signal.SIGINT, -signal.SIGTERM) or NO_SITE in said
    if ended_python and '/nodes/' not in said:
        # Python itself was still starting; there the signal ends it as it ends any script.
        return EARLY if not any(folder.iterdir()) else 'left something behind'
    if 'Traceback' in said:
        return f'traceback: {said[-1500:]}'
    if exit_code != (-signal.SIGKILL if way == 'SIGKILL' else 0):
        return f'exit code {exit_code}: {said[-500:]}'
    run = folder / 'run'
    if not run.is_dir():
        left = [path.name for path in folder.iterdir()]
        return f'left behind: {left}' if left else ''
    try:
        return _problem_of_run(way, run)
    except PaintError as error:
        return str(error)


def _problem_of_run(way: str, run: Path) -> str:
    ended_ns = (run / f'{run.name}_0.mcap').stat().st_mtime_ns
    if way != 'SIGKILL':
        if not (run / 'metadata.yaml').is_file():
            return 'told to end, and the run is not complete'
    else:
        try:
            run = recover(run, run.with_name('recovered'))[0].folder
        except PaintError as error:
            # Killed before the first chunk was old enough to be written.
            return '' if 'nothing to recover' in str(error) else str(error)
    try:
        stamps = read_recording(run).stamps_ns
    except PaintError as error:
        return (
            '' if 'no messages' in str(error) or 'name a pose topic' in str(error) else str(error)
        )
    if len(stamps) > 1 and np.diff(stamps).max() > 1_000_000_000 // RATE_HZ:
        return f'a hole of {np.diff(stamps).max() * 1e-9:.3f} s'
    # The robot stamps its poses by the clock.
    if (late_s := (ended_ns - stamps[-1]) * 1e-9) > 1.0:
        return f'ends {late_s:.2f} s early'
    return ''


@contextmanager
def robot() -> Iterator[None]:
    """A robot that publishes poses all the while, stamped by the clock at an even rate."""
    import rclpy
    from geometry_msgs.msg import PoseStamped
    from rclpy.qos import QoSProfile
    from rclpy.time import Time

    rclpy.init()
    node = rclpy.create_node('robot')
    publisher = node.create_publisher(PoseStamped, 'atomizer/pose', QoSProfile(depth=2000))
    ended = threading.Event()

    def publish() -> None:
        message, stamp_ns = PoseStamped(), time.time_ns()
        message.header.frame_id, message.pose.orientation.w = 'part', 1.0
        while not ended.is_set():
            stamp_ns += 1_000_000_000 // RATE_HZ
            time.sleep(max(0.0, (stamp_ns - time.time_ns()) * 1e-9))
            message.header.stamp = Time(nanoseconds=stamp_ns).to_msg()
            publisher.publish(message)

    thread = threading.Thread(target=publish)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
        node.destroy_node()
        rclpy.shutdown()


if __name__ == '__main__':
    main()
