"""Where a recording of a spraying gun breaks off or begins again, and what hangs on it."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.path_builder import gap_ns


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
    for before, row in pairwise([0, *(back + 1), len(path)][1:]):
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
