#!/usr/bin/env python3
"""Record the sample motions: ``door_horizontal``, ``door_vertical`` and ``panel_577``.

    python3 make_trajectory.py [FOLDER]

Three horizontal passes over the sample door, left to right, back, and left to right again, as in
Conner et al. (2002), section 4.3; five vertical passes over it; and the three passes over a flat
panel at an index of 577 mm. Each is a rosbag2 folder (MCAP) with the poses of the atomizer and
its trigger, logged as unevenly as a robot controller does. Lengths in metres, speeds in m/s.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from make_door import door_depth, evenly, ramp, rounded
from scipy.spatial.transform import Rotation

from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.motion.trajectory import Trajectory

STANDOFF_M = 0.25
# The taught path sees the surface through a window this wide, and turns the bell this share of the
# way from straight ahead to square on it.
SMOOTHING_M = 0.16
FOLLOWING = 0.6
EDGE_BLEND_M = 0.06

ACCELERATION_M_PER_S2 = 1.5
CORNER_RADIUS_M = 0.06
CORNER_SPEED_M_PER_S = 0.15
STEP_M = 0.002

SHORTEST_INTERVAL_S, LONGEST_INTERVAL_S = 0.0013, 0.024
# A controller polled faster than it computes repeats its last pose.
POLLED_TOO_EARLY_S, REPEATED_SHARE = 0.004, 0.3
RESOLUTION_M = 1e-5
STANDSTILL_S = 0.4
START_NS = 1_762_246_800_000_000_000
FRAME = 'part'


@dataclass(frozen=True)
class Job:
    """Parallel passes sprayed to and fro.

    Attributes:
        name: of the recording.
        passes: (P, 2, 2) start and end of each pass in x-z; the gun is on between them.
        run_out_m: way before and after each pass, at full speed and gun off.
        speed_m_per_s: of the TCP while spraying.
        surface_depth: y of the part over x and z.
        window: lowest and highest x, lowest and highest z of the part.
    """

    name: str
    passes: np.ndarray
    run_out_m: float
    speed_m_per_s: float
    surface_depth: object
    window: tuple[float, float, float, float]


def serpentine(lines: list[tuple[tuple, tuple]]) -> np.ndarray:
    """(P, 2, 2) passes of which every other one runs backwards."""
    passes = np.array(lines, dtype=float)
    passes[1::2] = passes[1::2, ::-1]
    return passes


def flat(x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """The panel."""
    return np.zeros(np.broadcast(x, z).shape)


DOOR = (-0.6, 0.6, 0.0, 0.88)
JOBS = (
    Job(
        'door_horizontal',
        serpentine([((-0.72, z), (0.72, z)) for z in (0.75, 0.45, 0.15)]),
        0.1,
        0.3,
        door_depth,
        DOOR,
    ),
    Job(
        'door_vertical',
        serpentine([((x, 1.02), (x, -0.14)) for x in (-0.56, -0.28, 0.0, 0.28, 0.56)]),
        0.1,
        0.35,
        door_depth,
        DOOR,
    ),
    Job(
        'panel_577',
        serpentine([((-0.75, z), (0.75, z)) for z in (1.577, 1.0, 0.423)]),
        0.1,
        0.15,
        flat,
        (-0.4, 0.4, 0.0, 2.0),
    ),
)


def route(job: Job) -> np.ndarray:
    """(N, 2) points every STEP_M along the passes, their run-outs and the rounded way between."""
    way = job.passes[:, 1] - job.passes[:, 0]
    way *= job.run_out_m / np.linalg.norm(way, axis=1, keepdims=True)
    corners = np.stack([job.passes[:, 0] - way, job.passes[:, 1] + way], axis=1).reshape(-1, 2)
    pieces = [corners[:1]]
    for before, corner, after in zip(corners[:-2], corners[1:-1], corners[2:], strict=True):
        enter = corner + CORNER_RADIUS_M * unit(before - corner)
        leave = corner + CORNER_RADIUS_M * unit(after - corner)
        pieces.append(rounded(enter, corner, leave, points=100))
    return evenly(np.concatenate([*pieces, corners[-1:]]), STEP_M)


def unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors of length one."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def timing(job: Job, points: np.ndarray) -> np.ndarray:
    """(N,) times [s] at which the robot passes the points, from standstill to standstill."""
    tcp_m, _ = tool_poses(job, points)
    step = np.linalg.norm(np.diff(tcp_m, axis=0), axis=1)
    ahead = unit(np.diff(points, axis=0))
    turning = np.append(np.linalg.norm(np.diff(ahead, axis=0), axis=1) > 1e-6, [False, False])
    speed = np.where(turning, CORNER_SPEED_M_PER_S, job.speed_m_per_s)
    speed[[0, -1]] = 0.0
    for n in range(1, len(speed)):
        reachable = np.sqrt(speed[n - 1] ** 2 + 2.0 * ACCELERATION_M_PER_S2 * step[n - 1])
        speed[n] = min(speed[n], reachable)
    for n in range(len(speed) - 2, -1, -1):
        stoppable = np.sqrt(speed[n + 1] ** 2 + 2.0 * ACCELERATION_M_PER_S2 * step[n])
        speed[n] = min(speed[n], stoppable)
    return np.concatenate([[0.0], np.cumsum(2.0 * step / (speed[1:] + speed[:-1]))])


def smoothed_depth(job: Job, x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Mean depth of the surface in a window about each point; straight on past the edges."""
    offsets = np.linspace(-0.5, 0.5, 9) * SMOOTHING_M
    lowest_x, highest_x, lowest_z, highest_z = job.window
    xs = held_within(x[:, None, None] + offsets[:, None], lowest_x, highest_x)
    zs = held_within(z[:, None, None] + offsets[None, :], lowest_z, highest_z)
    return job.surface_depth(xs, zs).mean(axis=(1, 2))


def held_within(value: np.ndarray, low: float, high: float) -> np.ndarray:
    """Go over smoothly from the value to the limits, over about EDGE_BLEND_M."""
    w = EDGE_BLEND_M
    return low + w * (ramp((value - low) / w) - ramp((value - high) / w))


def tool_poses(job: Job, points: np.ndarray) -> tuple[np.ndarray, Rotation]:
    """TCP (N, 3) and orientation of the tool: z to the surface, x level along the vehicle."""
    x, z = points.T
    small = 1e-4
    slope_x = smoothed_depth(job, x + small, z) - smoothed_depth(job, x - small, z)
    slope_z = smoothed_depth(job, x, z + small) - smoothed_depth(job, x, z - small)
    slopes = np.stack([slope_x, slope_z], axis=1) / (2.0 * small)
    tool_z = unit(np.stack([-slopes[:, 0], np.ones(len(x)), -slopes[:, 1]], axis=1)
                  * [FOLLOWING, 1.0, FOLLOWING])  # fmt: skip
    tool_y = unit(np.cross(tool_z, [1.0, 0.0, 0.0]))
    tool_x = np.cross(tool_y, tool_z)
    surface = np.stack([x, smoothed_depth(job, x, z), z], axis=1)
    axes = np.stack([tool_x, tool_y, tool_z], axis=2)
    return surface - STANDOFF_M * tool_z, Rotation.from_matrix(axes)


def trigger_times(job: Job, points: np.ndarray, times_s: np.ndarray) -> np.ndarray:
    """(2 P,) times at which the gun goes on and off [s]."""
    ends = job.passes.reshape(-1, 2)
    nearest = np.linalg.norm(points[:, None, :] - ends, axis=2).argmin(axis=0)
    return times_s[nearest]


def log_stamps_s(duration_s: float, rng: np.random.Generator) -> np.ndarray:
    """Stamps with the uneven intervals of a controller's log [s]."""
    span = LONGEST_INTERVAL_S - SHORTEST_INTERVAL_S
    count = int(2.0 * duration_s / SHORTEST_INTERVAL_S)
    stamps = np.cumsum(SHORTEST_INTERVAL_S + span * rng.beta(1.6, 3.2, size=count))
    return stamps[stamps < duration_s]


def recorded(job: Job, seed: int) -> Trajectory:
    """The job as the controller logs it."""
    rng = np.random.default_rng(seed)
    points = route(job)
    times_s = STANDSTILL_S + timing(job, points)
    stamps_s = log_stamps_s(times_s[-1] + STANDSTILL_S, rng)
    at = np.stack([np.interp(stamps_s, times_s, points[:, axis]) for axis in range(2)], axis=1)
    early = np.diff(stamps_s, prepend=-1.0) < POLLED_TOO_EARLY_S
    again = np.flatnonzero(early & (rng.random(len(at)) < REPEATED_SHARE))
    at[again] = at[again - 1]
    positions, orientations = tool_poses(job, at)
    on_off_s = trigger_times(job, points, times_s)
    return Trajectory(
        stamps_ns=START_NS + np.round(stamps_s * 1e9).astype(np.int64),
        positions_m=np.round(positions / RESOLUTION_M) * RESOLUTION_M,
        quaternions_xyzw=orientations.as_quat(),
        frame_id=FRAME,
        trigger_stamps_ns=START_NS + np.round(np.append(0.0, on_off_s) * 1e9).astype(np.int64),
        trigger_flow=np.append(0.0, np.tile([1.0, 0.0], len(job.passes))),
    )


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    for seed, job in enumerate(JOBS):
        trajectory = recorded(job, seed)
        write_pose_bag(folder / job.name, trajectory)
        print(f'{job.name}: {len(trajectory)} poses in {trajectory.duration_s:.1f} s')


if __name__ == '__main__':
    main()
