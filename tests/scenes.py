"""Small worlds for tests: a gun, a way for it, and surface to paint."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.path_builder import PathBuilder, spray_path
from paint_deposition.motion.pose_stream import PoseBatch, TriggerChange
from paint_deposition.motion.trajectory import PoseCounts, Trajectory
from paint_deposition.part.points import SurfacePoints
from paint_deposition.part.surface import Surface

START_NS = 1_760_000_000_000_000_000
# Tool z along -z of the world, tool x along its x: the gun looks down on a lying plane.
LOOKING_DOWN = np.array([1.0, 0.0, 0.0, 0.0])
NORMAL_STANDOFF_M = 0.25


def stamps_ns(times_s) -> np.ndarray:
    """Stamps of times after START_NS."""
    return START_NS + np.round(np.asarray(times_s, dtype=float) * 1e9).astype(np.int64)


def straight_pass(
    times_s,
    begin_m=(-0.6, 0.0, NORMAL_STANDOFF_M),
    end_m=(0.6, 0.0, NORMAL_STANDOFF_M),
    quaternion=LOOKING_DOWN,
    **trigger,
) -> Trajectory:
    """An even motion from begin to end, sampled at these times."""
    times = np.asarray(times_s, dtype=float)
    share = ((times - times[0]) / (times[-1] - times[0]))[:, np.newaxis]
    positions = (1.0 - share) * np.array(begin_m) + share * np.array(end_m)
    return Trajectory(stamps_ns(times), positions, np.tile(quaternion, (len(times), 1)), **trigger)


def weaving(times_s) -> Trajectory:
    """A curved way at changing speed with a tool that sways, as a function of time alone."""
    t = np.asarray(times_s, dtype=float)
    positions = np.stack(
        [0.45 * np.sin(0.7 * t), 0.25 * np.sin(1.1 * t + 0.4), 0.25 + 0.03 * np.sin(1.7 * t)],
        axis=1,
    )
    sway = Rotation.from_euler('xy', np.stack([0.2 * np.sin(t), 0.15 * np.cos(1.3 * t)], axis=1))
    quaternions = (Rotation.from_quat(LOOKING_DOWN) * sway).as_quat()
    return Trajectory(stamps_ns(t), positions, quaternions)


def lying_plane(half_m: float = 0.6, count: int = 41) -> SurfacePoints:
    """Square plane at z = 0 that looks up, with the area of each of its count^2 points."""
    line = np.linspace(-half_m, half_m, count)
    x, y = (grid.ravel() for grid in np.meshgrid(line, line))
    positions = np.stack([x, y, np.zeros(len(x))], axis=1)
    spacing = line[1] - line[0]
    return SurfacePoints(
        positions, np.tile([0.0, 0.0, 1.0], (len(x), 1)), area_m2=np.full(len(x), spacing**2),
        down=(0.0, -1.0, 0.0),
    )  # fmt: skip


def painted(
    points: SurfacePoints, motion: Trajectory | SprayPath, model=None, precision='single',
    occluder: Surface | None = None, **options,
) -> FilmIntegrator:  # fmt: skip
    """The integrator after a motion, cut into sub-steps as the model asks, or a path."""
    model = model or DepositionModel()
    path = motion
    if isinstance(motion, Trajectory):
        path, _ = spray_path(motion, 0.25, model.max_step_m, model.needs_whole_strokes)
    integrator = FilmIntegrator(points, model, precision, occluder, **options)
    integrator.add(path)
    return integrator


def rows_of(motion: Trajectory, rows: slice | np.ndarray, **told) -> Trajectory:
    """Some of its poses, with what else is told of it."""
    columns = ('stamps_ns', 'positions_m', 'quaternions_xyzw')
    return replace(motion, **{name: getattr(motion, name)[rows] for name in columns} | told)


def poses(motion: Trajectory, rows: slice) -> PoseBatch:
    """Some poses as they come in."""
    return PoseBatch(
        motion.stamps_ns[rows], motion.positions_m[rows], motion.quaternions_xyzw[rows]
    )


def streamed(
    motion: Trajectory, sizes: list[int], whole_strokes: bool
) -> tuple[list[SprayPath], PoseCounts]:
    """Sub-steps of poses that come in batches of these sizes, in turns, with their triggers."""
    builder = PathBuilder(whole_strokes=whole_strokes)
    first, *triggers = zip(motion.trigger_stamps_ns, motion.trigger_flow, strict=True)
    builder.add_trigger(*first)
    pieces = []
    start, turn = 0, 0
    while start < len(motion):
        rows = slice(start, start + sizes[turn % len(sizes)])
        start, turn = rows.stop, turn + 1
        builder.add_poses(poses(motion, rows))
        newest = motion.stamps_ns[rows][-1]
        while triggers and triggers[0][0] <= newest:
            builder.add_trigger(*triggers.pop(0))
        pieces.append(builder.take(newest - 100_000_000))
    pieces.append(builder.take(finish=True))
    return pieces, builder.screen.counts


def changes_of(motion: Trajectory) -> list[TriggerChange]:
    """The changes of its trigger, with brush and set-points."""
    return [TriggerChange(*told) for told in motion.triggers]


def events(
    motion: Trajectory, batch: int, delay_s: float = 0.0
) -> list[PoseBatch | TriggerChange]:
    """The motion as it comes in: batches of poses, each change of the trigger so much late."""
    coming = [
        (int(motion.stamps_ns[k]), poses(motion, slice(k, k + batch)))
        for k in range(0, len(motion), batch)
    ]
    coming += [(one.stamp_ns + round(delay_s * 1e9), one) for one in changes_of(motion)]
    return [event for _, event in sorted(coming, key=lambda item: item[0])]
