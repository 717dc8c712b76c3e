"""What is wrong with a recorded motion: nothing moves or sprays, it breaks off or begins again."""

from collections.abc import Iterator
from itertools import pairwise
from typing import NoReturn

import numpy as np

from paint_deposition.errors import RecordingError
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.path_builder import DEFAULT_MAX_STEP_M, spray_path
from paint_deposition.motion.stream_quality import MANY_REPEATED
from paint_deposition.motion.trajectory import PoseCounts, Trajectory, gap_ns


def checked_path(
    trajectory: Trajectory, max_pose_gap_s: float, max_step_m: float = DEFAULT_MAX_STEP_M
) -> tuple[SprayPath, PoseCounts, tuple[str, ...]]:
    """``spray_path`` of a recording, what was dropped, and warnings of ``interruptions``.

    Raises RecordingError, saying why, for one without a single sub-step or along which the gun
    never sprays.
    """
    path, counts = spray_path(trajectory, max_pose_gap_s, max_step_m)
    if not len(path):
        _refuse_motion(trajectory, counts, max_pose_gap_s)
    if not np.any(path.flow > 0.0):
        _refuse_trigger(trajectory)
    odd = list(interruptions(path, max_pose_gap_s))
    if counts.repeated_stamps > MANY_REPEATED * counts.received:
        odd.append(
            f'{counts.repeated_stamps} of {counts.received} poses dropped, for they repeat the '
            'stamp before them: the stamps look rounded, or poses recorded twice; record stamps '
            'with all their digits'
        )
    return path, counts, tuple(odd)


def interruptions(path: SprayPath, max_pose_gap_s: float) -> Iterator[str]:
    """Yield a warning of gaps while the gun sprayed, and one of streams that began again.

    Args:
        path: of one gun, in the order of the recording.
        max_pose_gap_s: a longer time between two poses counts as gun off [s].
    """
    half_ns = np.rint(0.5e9 * path.dwell_s).astype(np.int64)
    begin, end = path.stamp_ns - half_ns, path.stamp_ns + half_ns
    between = begin[1:] - end[:-1]
    sprays = path.flow > 0.0
    # The halves of two sub-steps are rounded, each to a nanosecond.
    (gaps,) = np.nonzero((between > gap_ns(max_pose_gap_s) - 4) & sprays[1:] & sprays[:-1])
    if len(gaps):
        longest = gaps[np.argmax(between[gaps])]
        flow = 0.5 * (path.flow[gaps] + path.flow[gaps + 1])
        missing = 1e-9 * float(between[gaps] @ flow) / path.spraying_time_s
        count = 'a gap' if len(gaps) == 1 else f'{len(gaps)} gaps'
        yield (
            f'{count} in the poses while the gun sprayed, {1e-9 * between[gaps].sum():.2f} s in '
            f'all, the longest {1e-9 * between[longest]:.2f} s from {_place(path, longest)} to '
            f'{_place(path, longest + 1)}: taken as gun off; if it sprayed there, '
            f'{100.0 * missing:.1f} % more paint was sprayed than is computed: record without '
            'gaps, or see --max-pose-gap-s (max_pose_gap_s in a campaign)'
        )
    (back,) = np.nonzero(np.diff(path.stamp_ns) < 0)
    for before, row in pairwise([*(back + 1), len(path)]):
        again = path.select(slice(before, row))
        share = again.spraying_time_s / path.spraying_time_s
        first = path.select(slice(0, len(again)))
        twice = np.array_equal(first.stamp_ns, again.stamp_ns) and np.array_equal(
            first.position_m, again.position_m
        )
        cause = 'another run follows in the file'
        if twice:
            cause = 'the same poses come again, as if the log were in the file twice'
        yield (
            f'the stamps start again at {_place(path, before)}: a second coat, '
            f'{100.0 * share:.1f} % of the paint; {cause}: keep one of them if it is not so'
        )


def _place(path: SprayPath, row: int) -> str:
    x, y, z = path.position_m[row]
    return f'({x:.2f}, {y:.2f}, {z:.2f}) m'


def _refuse_motion(trajectory: Trajectory, counts: PoseCounts, max_pose_gap_s: float) -> NoReturn:
    """Say what became of the poses."""
    reasons = {
        'not finite': counts.not_finite,
        'without a unit quaternion': counts.not_unit_quaternions,
        'with a repeated stamp': counts.repeated_stamps,
        'with a backward stamp': counts.backward_stamps,
        f'after a gap of more than {max_pose_gap_s:g} s': counts.gaps,
    }
    found = ', '.join(f'{count} {what}' for what, count in reasons.items() if count)
    remedy = 'record again, or see --max-pose-gap-s'
    if counts.gaps:
        apart_s = 1e-9 * float(np.median(np.abs(np.diff(trajectory.stamps_ns))))
        if apart_s <= 1e3 * max_pose_gap_s:
            remedy = (
                f'they are {apart_s:.3g} s apart: if these are milliseconds, give the unit in the '
                f'heading, as in time [ms]; else {remedy}'
            )
    raise RecordingError(
        f'{trajectory.source}: no two of its {counts.received} poses make a motion'
        f'{f" ({found})" if found else ""}; {remedy}'
    )


def _refuse_trigger(trajectory: Trajectory) -> NoReturn:
    stamps_ns, flow = trajectory.trigger_stamps_ns, trajectory.trigger_flow
    remedy = 'check --state-topic; without a trigger the gun sprays whenever poses flow'
    if not np.any(flow > 0.0):
        raise RecordingError(
            f'{trajectory.source}: the gun never sprays, none of the {len(flow)} messages of its '
            f'trigger opens it; {remedy}'
        )
    apart_s = 1e-9 * float(stamps_ns[np.argmax(flow > 0.0)] - trajectory.stamps_ns.min())
    raise RecordingError(
        f'{trajectory.source}: the gun never sprays while there are poses, its trigger first '
        f'opens {abs(apart_s):.3g} s {"after" if apart_s > 0.0 else "before"} the first of them: '
        f'check that both are stamped by one clock; {remedy}'
    )
