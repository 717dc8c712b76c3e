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
from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np
import trimesh
from benchmarks.live import Robots, cpu_s, start_node
from paint_msgs.srv import SaveFilm
from std_srvs.srv import Trigger

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
    os.environ.update(ALONE)
    with ExitStack() as running:
        simulator, _ = start_node(
            running, folder, 'deposition_simulator', mesh_file=mesh, max_edge_length_m=edge_m
        )
        recorder, _ = start_node(
            running, folder, 'run_recorder', name='run', topics='[atomizer/pose, atomizer/state]'
        )
        robot = running.enter_context(Robots(['']))
        robot.wait_until_heard(2)
        memory: dict[subprocess.Popen, list[tuple[float, float]]] = {simulator: [], recorder: []}
        sent = len(robot.paint(minutes * 60.0, rate_hz, passes, partial(_sample, memory)))
        simulator_s = cpu_s(simulator)
        robot.wait_for_all(sent)
        saved = _call(robot, SaveFilm, 'deposition_simulator/save_film', name='soak')
        if not saved.success:
            raise click.ClickException(saved.message)
        _call(robot, Trigger, 'run_recorder/stop')
        recorder.wait(60)
    offline, recorded = _offline(folder, mesh, edge_m)
    live = np.genfromtxt(folder / 'soak.csv', delimiter=',', names=True)['thickness_um']
    (sim_mb, sim_slope), (rec_mb, rec_slope) = map(_memory_of, memory.values())
    minute_s = POSES_A_MINUTE / rate_hz
    return Outcome(
        minutes=minutes,
        rate_hz=rate_hz,
        vertices=len(live),
        sent=sent,
        painted=robot.stats.poses_received - robot.stats.poses_rejected,
        recorded=recorded,
        simulator_mb=sim_mb,
        simulator_slope_mb=sim_slope * minute_s,
        recorder_mb=rec_mb,
        recorder_slope_mb=rec_slope * minute_s,
        simulator_cpu=simulator_s / (minutes * 60.0),
        film_um=float(live.max()),
        difference_um=float(np.abs(live - offline).max()),
    )


def passes(at_s: float, _gun: int) -> tuple[float, float, bool]:
    """To and fro, one each 4 s, a centimetre lower each time; off at the turns."""
    number, along = divmod(at_s / 4.0, 1.0)
    x = 2.0 * (along if number % 2 == 0 else 1.0 - along) - 1.0
    return x, 0.4 - 0.01 * (number % 80), abs(x) < 0.9


def _call(robot: Robots, kind: type, name: str, /, **fields: object) -> Any:
    """The answer of a service."""
    deadline = time.monotonic() + 300.0
    client = robot.node.create_client(kind, name)
    asked = None
    while asked is None or not asked.done():
        if time.monotonic() > deadline:
            raise click.ClickException(f'no answer of {name} within 300 s')
        if asked is None and client.service_is_ready():
            asked = client.call_async(kind.Request(**fields))
        robot.spin(0.05)
    return asked.result()


def _offline(folder: Path, mesh: Path, edge_m: float) -> tuple[np.ndarray, int]:
    """The film that `paint simulate` has from the recording, and the poses in it."""
    subprocess.run(
        ['paint', 'simulate', '--mesh', mesh, '--trajectory', folder / 'run', '--state-topic',
         '/atomizer/state', '--max-edge-length-m', str(edge_m), '-o', folder / 'offline'],
        check=True, capture_output=True,
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


if __name__ == '__main__':
    main()
