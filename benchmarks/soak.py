"""A cell under load for a long time: what is lost, how memory grows, whether the film is right.

A robot sends 250 poses a second, or more, over a part of 200,000 vertices; the simulator paints
them and the recorder writes them, each in a process of its own. At the end the film that the
simulator saves is compared with the one that `paint simulate` computes from the recording.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path

import click
import numpy as np
import trimesh

# A minute of motion at 250 Hz, whatever the rate here.
RATE_HZ, POSES_A_MINUTE = 250, 15_000
PART_M = (1.6, 0.8)
EDGE_M = {200_000: 0.0036, 50_000: 0.0115, 3_000: 0.036}
SAMPLE_S = 5.0
# The first part of a run fills caches and queues; the slope is of the rest.
WARM_SHARE = 0.25
LARGEST_SLOPE_MB = 1.0
ALONE = {'OPENBLAS_NUM_THREADS': '1', 'NUMBA_NUM_THREADS': '1'}


@dataclass(frozen=True)
class Outcome:
    """Figures of a soak.

    ``lost`` counts poses that the simulator or the recorder did not get; slopes are of resident
    memory after the warm part, for as many poses as a minute at 250 Hz has, 0.96 MB of which are
    the poses that the simulator keeps to paint them again; the difference is of live and offline
    film [um].
    """

    minutes: float
    rate_hz: int
    vertices: int
    sent: int
    painted: int
    recorded: int
    simulator_mb: float
    simulator_slope_mb: float
    recorder_mb: float
    recorder_slope_mb: float
    simulator_cpu: float
    film_um: float
    difference_um: float

    @property
    def lost(self) -> int:
        return 2 * self.sent - self.painted - self.recorded

    @property
    def sound(self) -> bool:
        slopes = (self.simulator_slope_mb, self.recorder_slope_mb)
        return not self.lost and not self.difference_um and max(slopes) < LARGEST_SLOPE_MB


@click.command()
@click.option('--minutes', default=30.0, show_default=True)
@click.option('--vertices', default='200000', type=click.Choice([str(count) for count in EDGE_M]))
@click.option('--rate', default=RATE_HZ, show_default=True, help='Poses a second.')
@click.option('--place', default='runs/soak', type=click.Path(path_type=Path), show_default=True)
def main(minutes: float, vertices: str, rate: int, place: Path) -> None:
    """Run the cell for so long; print the figures, and end with 1 where one is not good."""
    outcome = soak(minutes, int(vertices), rate, place / time.strftime('%Y%m%d_%H%M%S'))
    print(json.dumps(asdict(outcome) | {'lost': outcome.lost}, indent=2))
    sys.exit(0 if outcome.sound else 1)


def soak(minutes: float, vertices: int, rate_hz: int, folder: Path) -> Outcome:
    """Run simulator, recorder and robot, and compare the films.

    Args:
        minutes: of motion.
        vertices: of the part, one of EDGE_M, about.
        rate_hz: of the poses.
        folder: for everything that is written.
    """
    folder.mkdir(parents=True)
    mesh = folder / 'part.stl'
    width, height = (half / 2 for half in PART_M)
    corners = [[-width, 0, -height], [width, 0, -height], [width, 0, height], [-width, 0, height]]
    trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False).export(mesh)
    edge_m = EDGE_M[vertices]
    with ExitStack() as running:
        simulator = _node(
            running, folder, 'deposition_simulator', mesh_file=mesh, max_edge_length_m=edge_m,
            output_directory=folder,
        )  # fmt: skip
        recorder = _node(
            running, folder, 'run_recorder', output_directory=folder, name='run',
            topics='[atomizer/pose, atomizer/state]',
        )  # fmt: skip
        robot = running.enter_context(_Robot(rate_hz))
        robot.wait_for(2, [simulator, recorder])
        memory: dict[subprocess.Popen, list[tuple[float, float]]] = {simulator: [], recorder: []}
        robot.paint(minutes * 60.0, lambda now_s: _sample(memory, now_s))
        cpu_s = _cpu_s(simulator)
        stats = robot.stats_when(robot.sent)
        robot.save('soak')
        robot.stop_recorder()
        recorder.wait(60)
    offline, recorded = _offline(folder, mesh, edge_m)
    live = np.genfromtxt(folder / 'soak.csv', delimiter=',', names=True)['thickness_um']
    (sim_mb, sim_slope), (rec_mb, rec_slope) = map(_memory_of, memory.values())
    minute_s = POSES_A_MINUTE / rate_hz
    return Outcome(
        minutes=minutes,
        rate_hz=rate_hz,
        vertices=len(live),
        sent=robot.sent,
        painted=stats.poses_received - stats.poses_rejected,
        recorded=recorded,
        simulator_mb=sim_mb,
        simulator_slope_mb=sim_slope * minute_s,
        recorder_mb=rec_mb,
        recorder_slope_mb=rec_slope * minute_s,
        simulator_cpu=cpu_s / (minutes * 60.0),
        film_um=float(live.max()),
        difference_um=float(np.abs(live - offline).max()),
    )


def _node(
    running: ExitStack, folder: Path, executable: str, **parameters: object
) -> subprocess.Popen:
    """A node that is ended with `running`."""
    arguments = [part for key, value in parameters.items() for part in ('-p', f'{key}:={value}')]
    with (folder / f'{executable}.log').open('wb') as log:
        process = subprocess.Popen(
            [executable, '--ros-args', *arguments], stdout=log, stderr=log, env=os.environ | ALONE
        )
    running.callback(process.wait, 60)
    running.callback(process.terminate)
    return process


def _offline(folder: Path, mesh: Path, edge_m: float) -> tuple[np.ndarray, int]:
    """The film that `paint simulate` has from the recording, and the poses in it."""
    subprocess.run(
        ['paint', 'simulate', '--mesh', mesh, '--trajectory', folder / 'run', '--state-topic',
         '/atomizer/state', '--max-edge-length-m', str(edge_m), '-o', folder / 'offline'],
        check=True, capture_output=True, env=os.environ | ALONE,
    )  # fmt: skip
    told = subprocess.run(
        ['paint', 'inspect', folder / 'run', '--json'], check=True, capture_output=True, text=True
    )
    (stream,) = json.loads(told.stdout)['pose_streams']
    film = np.genfromtxt(folder / 'offline/film.csv', delimiter=',', names=True)
    return film['thickness_um'], stream['poses']


def _sample(memory: dict[subprocess.Popen, list[tuple[float, float]]], now_s: float) -> None:
    for process, rows in memory.items():
        if not rows or now_s - rows[-1][0] >= SAMPLE_S:
            status = Path(f'/proc/{process.pid}/status').read_text()
            rows.append((now_s, int(re.search(r'VmRSS:\s+(\d+)', status)[1]) * 1.024e-3))


def _memory_of(rows: list[tuple[float, float]]) -> tuple[float, float]:
    """Resident memory at the end [MB] and its slope after the warm part [MB/s]."""
    times_s, used_mb = np.array(rows).T
    later = times_s >= times_s[0] + WARM_SHARE * np.ptp(times_s)
    slope = np.polyfit(times_s[later], used_mb[later], 1)[0] if later.sum() > 2 else 0.0
    return float(used_mb[-1]), float(slope)


def _cpu_s(process: subprocess.Popen) -> float:
    fields = Path(f'/proc/{process.pid}/stat').read_text().rsplit(')', 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


class _Robot:
    """Publishes the motion, and asks the nodes for what they have."""

    def __init__(self, rate_hz: int) -> None:
        self._rate_hz = rate_hz

    def __enter__(self) -> _Robot:
        import rclpy
        from geometry_msgs.msg import PoseStamped
        from paint_msgs.msg import AtomizerState, ThicknessStats
        from rclpy.qos import DurabilityPolicy, QoSProfile

        rclpy.init()
        self._node = rclpy.create_node('soak_robot')
        profile = QoSProfile(depth=2000)
        self._poses = self._node.create_publisher(PoseStamped, 'atomizer/pose', profile)
        self._states = self._node.create_publisher(AtomizerState, 'atomizer/state', profile)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._stats = ThicknessStats()
        self._node.create_subscription(ThicknessStats, 'thickness/stats', self._take, latched)
        self.sent = 0
        return self

    def __exit__(self, *_: object) -> None:
        import rclpy

        self._node.destroy_node()
        rclpy.shutdown()

    def _take(self, stats: object) -> None:
        self._stats = stats

    def _spin(self, seconds: float = 0.0) -> None:
        import rclpy

        rclpy.spin_once(self._node, timeout_sec=seconds)

    def _until(self, condition: object, what: str, timeout_s: float = 300.0) -> None:
        deadline = time.monotonic() + timeout_s
        while not condition():
            if time.monotonic() > deadline:
                raise click.ClickException(f'{what} did not come within {timeout_s:.0f} s')
            self._spin(0.05)

    def wait_for(self, count: int, processes: list[subprocess.Popen]) -> None:
        """Wait until so many nodes listen to poses and states; the film follows soon after."""

        def listen() -> bool:
            if any(process.poll() is not None for process in processes):
                raise click.ClickException('a node has ended; see its log')
            publishers = (self._poses, self._states)
            return all(each.get_subscription_count() >= count for each in publishers)

        self._until(listen, f'{count} subscribers')
        for _ in range(20):
            self._spin(0.1)

    def paint(self, seconds: float, on_time: object) -> None:
        """Passes to and fro, one each 4 s, a centimetre lower each time; off at the turns."""
        from geometry_msgs.msg import PoseStamped
        from paint_msgs.msg import AtomizerState
        from rclpy.time import Time

        message, state = PoseStamped(), AtomizerState()
        message.header.frame_id = 'part'
        q, p = message.pose.orientation, message.pose.position
        q.x, q.w = -float(np.sqrt(0.5)), float(np.sqrt(0.5))
        p.y, started_ns, began_s, spraying = -0.25, time.time_ns(), time.monotonic(), None
        for row in range(round(seconds * self._rate_hz)):
            at_s = row / self._rate_hz
            while (early_s := began_s + at_s - time.monotonic()) > 0.0:
                self._spin(early_s)
            stamp = Time(nanoseconds=started_ns + row * 1_000_000_000 // self._rate_hz).to_msg()
            number, along = divmod(at_s / 4.0, 1.0)
            along = along if number % 2 == 0 else 1.0 - along
            p.x, p.z = 2.0 * along - 1.0, 0.4 - 0.01 * (number % 80)
            on = abs(p.x) < 0.9
            if on != spraying:
                spraying = on
                state.spraying, state.header.stamp = on, stamp
                self._states.publish(state)
            message.header.stamp = stamp
            self._poses.publish(message)
            self.sent += 1
            on_time(at_s)

    def stats_when(self, count: int) -> object:
        """The statistics once so many poses are painted, or after half a minute."""
        deadline = time.monotonic() + 30.0
        while self._stats.poses_received < count and time.monotonic() < deadline:
            self._spin(0.1)
        return self._stats

    def _call(self, kind: type, name: str, request: object) -> object:
        client = self._node.create_client(kind, name)
        self._until(client.service_is_ready, name)
        future = client.call_async(request)
        self._until(future.done, f'the answer of {name}')
        return future.result()

    def save(self, name: str) -> None:
        """Have the simulator write its film."""
        from paint_msgs.srv import SaveFilm

        saved = self._call(SaveFilm, 'deposition_simulator/save_film', SaveFilm.Request(name=name))
        if not saved.success:
            raise click.ClickException(saved.message)

    def stop_recorder(self) -> None:
        """Complete the recording."""
        from std_srvs.srv import Trigger

        self._call(Trigger, 'run_recorder/stop', Trigger.Request())


if __name__ == '__main__':
    main()
