"""A cell of two guns on a large part: what the simulator takes, and how old its figures are.

    python -m benchmarks.live [--vertices 500000] [--seconds 20] [--watch TOPIC ...] [--json FILE]

The simulator, a robot that sends two guns' poses at 250 Hz each, and whoever watches are
processes of their own on one machine; messages go through the real middleware. The simulator
starts anew for each way to watch: nobody, somebody who takes a topic as bytes, or the recorder
with all that it records by default. A pose's age is the time from its stamp, which is when it is
sent, to the arrival of the first statistics that are no older. Processor time is that of the
simulator, all threads, until it has painted everything, over the time of the motion.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks import file_to_film as side

GUNS = ('robot_1', 'robot_2')
NAMED = '[robot_1, robot_2]'
RATE_HZ = 250
SPEED_M_PER_S = 0.5
RECORDER = 'run_recorder'
WATCHED = (
    '', 'thickness/field', 'thickness/cloud', 'thickness/mesh', RECORDER,
)  # fmt: skip
# Poses before are not counted: queues and caches fill.
WARM_S = 2.0
READY_WITHIN_S = 120.0
HEARD_WITHIN_S = 30.0
CLOCK_HZ = os.sysconf('SC_CLK_TCK')


def cpu_s(process: subprocess.Popen) -> float:
    """Processor time of a process so far [s]."""
    fields = Path(f'/proc/{process.pid}/stat').read_text().rsplit(')', 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / CLOCK_HZ


def peak_mb(process: subprocess.Popen) -> float:
    """Most memory that a process held so far [MB]."""
    status = Path(f'/proc/{process.pid}/status').read_text()
    return int(re.search(r'VmHWM:\s+(\d+)', status)[1]) / 1024


def start_simulator(running: ExitStack, folder: Path) -> tuple[subprocess.Popen, float]:
    """The simulator on the folder's part, and the time to `ready` in its log [s]."""
    return start_node(
        running, folder, 'deposition_simulator', mesh_file=folder / 'part.stl',
        max_edge_length_m=side.COARSER_THAN_ANY_M, atomizers=NAMED,
    )  # fmt: skip


def start_node(
    running: ExitStack, folder: Path, executable: str, **parameters: object
) -> tuple[subprocess.Popen, float]:
    """A node that ends with `running`, and the time to `ready` in its log [s]."""
    parameters['output_directory'] = folder
    given = [part for name, value in parameters.items() for part in ('-p', f'{name}:={value}')]
    log = folder / f'{executable}.log'
    with log.open('wb') as file:
        began_s = time.monotonic()
        process = subprocess.Popen([executable, '--ros-args', *given], stdout=file, stderr=file)
    running.callback(process.wait, 60)
    running.callback(process.terminate)
    while b': ready' not in log.read_bytes():
        if process.poll() is not None or time.monotonic() - began_s > READY_WITHIN_S:
            raise SystemExit(f'{executable} does not get ready:\n{log.read_text()}')
        time.sleep(0.002)
    return process, time.monotonic() - began_s


def start_watching(running: ExitStack, topic: str) -> subprocess.Popen:
    """A process that takes a topic as bytes until it is told to stop."""
    process = subprocess.Popen(
        [sys.executable, '-m', 'benchmarks.live', '--watch-only', topic],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    running.callback(process.kill)
    process.stdout.readline()
    return process


def watch(topic: str) -> None:
    """Take a topic's messages as bytes; say how many there were, and how large, in the end."""
    import threading

    import rclpy
    from paint_msgs.msg import ThicknessField
    from rclpy.qos import QoSProfile
    from sensor_msgs.msg import PointCloud2
    from visualization_msgs.msg import Marker

    types = {'thickness/field': ThicknessField, 'thickness/mesh': Marker}
    sizes: list[int] = []
    stop = threading.Event()
    rclpy.init()
    node = rclpy.create_node('watcher')
    node.create_subscription(
        types.get(topic, PointCloud2), topic, lambda data: sizes.append(len(data)),
        QoSProfile(depth=10), raw=True,
    )  # fmt: skip
    threading.Thread(target=lambda: (sys.stdin.readline(), stop.set()), daemon=True).start()
    print('watching', flush=True)
    while not stop.is_set():
        rclpy.spin_once(node, timeout_sec=0.1)
    print(json.dumps({'messages': len(sizes), 'bytes': sum(sizes)}))
    rclpy.try_shutdown()


class Robots:
    """Publishes the poses of guns, '' for an only one, and notes when statistics arrive."""

    def __init__(self, guns: Sequence[str]) -> None:
        import rclpy
        from geometry_msgs.msg import PoseStamped
        from paint_msgs.msg import AtomizerState, ThicknessStats
        from rclpy.qos import DurabilityPolicy, QoSProfile

        rclpy.init()
        self.node = rclpy.create_node('robots')
        profile, spaces = QoSProfile(depth=2000), [f'{gun}/' if gun else '' for gun in guns]
        self._poses, self._states = (
            [self.node.create_publisher(kind, f'{of}atomizer/{topic}', profile) for of in spaces]
            for kind, topic in ((PoseStamped, 'pose'), (AtomizerState, 'state'))
        )
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.node.create_subscription(ThicknessStats, 'thickness/stats', self._note, latched)
        self.arrived: list[tuple[int, int]] = []
        self.stats = ThicknessStats()

    def __enter__(self) -> 'Robots':
        return self

    def __exit__(self, *_: object) -> None:
        import rclpy

        self.node.destroy_node()
        rclpy.try_shutdown()

    def _note(self, stats: Any) -> None:
        stamp = stats.header.stamp
        self.arrived.append((stamp.sec * 1_000_000_000 + stamp.nanosec, time.time_ns()))
        self.stats = stats

    def spin(self, seconds: float) -> None:
        """Take what comes for so long, or until something has come."""
        import rclpy

        rclpy.spin_once(self.node, timeout_sec=max(0.0, seconds))

    def wait_until_heard(self, count: int = 1) -> None:
        """Wait until so many nodes listen to everything."""
        deadline = time.monotonic() + HEARD_WITHIN_S
        publishers = *self._poses, *self._states
        while not all(each.get_subscription_count() >= count for each in publishers):
            if time.monotonic() > deadline:
                raise SystemExit('a node does not listen')
            self.spin(0.05)
        for _ in range(10):
            self.spin(0.05)

    def paint(
        self,
        seconds: float,
        rate_hz: int,
        motion: Callable[[float, int], tuple[float, float, bool]],
        on_time: Callable[[float], None] = lambda at_s: None,
    ) -> np.ndarray:
        """Send all guns' poses at this rate; the stamps [ns].

        ``motion`` gives of a time [s] and the number of a gun x and z [m], and whether it sprays.
        """
        from geometry_msgs.msg import PoseStamped
        from paint_msgs.msg import AtomizerState
        from rclpy.time import Time

        message = PoseStamped()
        message.header.frame_id = 'part'
        q, p = message.pose.orientation, message.pose.position
        q.x, q.w, p.y = -float(np.sqrt(0.5)), float(np.sqrt(0.5)), -side.STANDOFF_M
        began_s, stamps = time.monotonic(), []
        spraying: list[bool | None] = [None] * len(self._poses)
        for row in range(round(seconds * rate_hz)):
            at_s = row / rate_hz
            while (early_s := began_s + at_s - time.monotonic()) > 0.0:
                self.spin(early_s)
            now = time.time_ns()
            message.header.stamp = Time(nanoseconds=now).to_msg()
            stamps.append(now)
            for gun, publisher in enumerate(self._poses):
                p.x, p.z, sprays = motion(at_s, gun)
                if sprays != spraying[gun]:
                    spraying[gun] = sprays
                    state = AtomizerState(spraying=sprays)
                    state.header.stamp = message.header.stamp
                    self._states[gun].publish(state)
                publisher.publish(message)
            on_time(at_s)
        return np.array(stamps)

    def wait_for_all(self, count: int) -> None:
        """Wait for statistics of so many poses."""
        deadline = time.monotonic() + HEARD_WITHIN_S
        while self.stats.poses_received < count and time.monotonic() < deadline:
            self.spin(0.05)


def to_and_fro(at_s: float, gun: int) -> tuple[float, float, bool]:
    """One gun on the upper and one on the lower half."""
    number, along = divmod(at_s * SPEED_M_PER_S / side.LENGTH_M, 1.0)
    x = side.LENGTH_M * (along if (number + gun) % 2 == 0 else 1.0 - along)
    return x, side.HEIGHT_M / 2 * (gun + (0.15 + 0.2 * number) % 1.0), True


def ages_s(stamps_ns: np.ndarray, arrived: list[tuple[int, int]]) -> np.ndarray:
    """From each pose to the first statistics that are no older [s]; inf where none came."""
    newest, came = np.array(arrived).T
    first = np.searchsorted(np.maximum.accumulate(newest), stamps_ns)
    came = np.append(came.astype(float), np.inf)
    return (came[first] - stamps_ns) * 1e-9


def measure(folder: Path, seconds: float, topic: str) -> dict[str, Any]:
    """One run of the cell with somebody who takes a topic, '' for nobody."""
    with ExitStack() as running:
        simulator, ready_s = start_simulator(running, folder)
        robots = running.enter_context(Robots(GUNS))
        robots.wait_until_heard()
        watcher = recorder = None
        if topic == RECORDER:
            recorder, _ = start_node(running, folder, RECORDER, name='run', atomizers=NAMED)
        elif topic:
            watcher = start_watching(running, topic)
        began_s, began_cpu_s = time.monotonic(), cpu_s(simulator)
        stamps = robots.paint(seconds, RATE_HZ, to_and_fro)
        lasted_s = time.monotonic() - began_s
        robots.wait_for_all(len(GUNS) * len(stamps))
        share = (cpu_s(simulator) - began_cpu_s) / lasted_s
        ages = ages_s(stamps[stamps > stamps[0] + WARM_S * 1e9], robots.arrived)
        seen = {'messages': 0, 'bytes': 0}
        if recorder:
            seen['share'] = cpu_s(recorder) / lasted_s
            seen['bytes'] = sum(file.stat().st_size for file in (folder / 'run').iterdir())
        if watcher:
            seen = json.loads(watcher.communicate('stop\n', timeout=60)[0])
        return {
            'watched': topic or 'nobody',
            'ready_s': ready_s,
            'processor_share': share,
            'age_median_s': float(np.median(ages)),
            'age_95_s': float(np.quantile(ages, 0.95, method='higher')),
            'poses_sent': len(GUNS) * len(stamps),
            'poses_received': robots.stats.poses_received,
            'messages_per_s': seen['messages'] / lasted_s,
            'mb_per_s': seen['bytes'] / lasted_s * 1e-6,
            'memory_mb': peak_mb(simulator),
            'recorder_share': seen.get('share'),
        }


def main() -> None:
    """Measure all ways to watch."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--vertices', type=int, default=500_000)
    parser.add_argument('--seconds', type=float, default=20.0, help='of motion in each run')
    parser.add_argument('--watch', nargs='*', default=WATCHED, help="topics; '' is nobody")
    parser.add_argument('--json', type=Path, help='also write the figures to this file')
    parser.add_argument('--watch-only', help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.watch_only:
        watch(given.watch_only)
        return
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        corners, faces = side.body_side(given.vertices)
        side.write_stl(folder / 'part.stl', corners, faces)
        with ExitStack() as running:
            start_simulator(running, folder)  # compiles what is not compiled yet
        print(
            f'{len(np.unique(faces))} vertices, two guns at {RATE_HZ} Hz\n'
            f'{"watched":20}{"ready":>8}{"processor":>11}'
            f'{"age of a pose, 50, 95 %":>25}{"messages/s":>12}{"MB/s":>8}{"memory":>10}'
            f'{"lost":>6}'
        )
        rows = []
        for topic in given.watch:
            row = measure(folder, given.seconds, topic)
            rows.append(row)
            print(
                f'{row["watched"]:20}{row["ready_s"]:6.2f} s{row["processor_share"]:9.0%}  '
                f'{row["age_median_s"] * 1e3:13.0f}, {row["age_95_s"] * 1e3:.0f} ms'
                f'{row["messages_per_s"]:12.1f}{row["mb_per_s"]:8.1f}{row["memory_mb"]:7.0f} MB'
                f'{row["poses_sent"] - row["poses_received"]:6}',
                flush=True,
            )
    if given.json:
        record = {'vertices': given.vertices, 'runs': rows}
        given.json.write_text(json.dumps(record, indent=1), encoding='utf-8')


if __name__ == '__main__':
    main()
