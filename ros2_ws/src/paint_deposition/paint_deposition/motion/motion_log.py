"""What came of a stream of poses and trigger changes, kept so that it can be followed again."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from paint_deposition.motion.trigger import ONLY_BRUSH

# Two hours at 250 Hz; about 100 bytes a pose as they come.
DEFAULT_LIMIT_POSES = 2_000_000
MERGED_POSES = 200


@dataclass(frozen=True)
class TriggerChange:
    """The flow (relative; 0 is gun off) from a time on, and the number of the brush."""

    stamp_ns: int
    flow: float
    brush: int = ONLY_BRUSH


@dataclass(frozen=True)
class PoseBatch:
    """Poses that were taken together: (N,) int64, (N, 3) [m], (N, 4) scalar last."""

    stamps_ns: np.ndarray
    positions_m: np.ndarray
    quaternions_xyzw: np.ndarray

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def select(self, rows: slice | list[int] | np.ndarray) -> 'PoseBatch':
        """The chosen rows."""
        chosen = rows if isinstance(rows, slice) else np.asarray(rows, dtype=np.int64)
        return PoseBatch(*(column[chosen] for column in vars(self).values()))

    def finite_axes(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions (M, 3) [m] and tool z (M, 3) of the poses that are finite."""
        finite = np.isfinite(self.quaternions_xyzw).all(axis=1)
        finite &= np.isfinite(self.positions_m).all(axis=1)
        x, y, z, w = self.quaternions_xyzw[finite].T
        axes = [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)]
        return self.positions_m[finite], np.stack(axes, axis=1)

    @staticmethod
    def joined(batches: list['PoseBatch']) -> 'PoseBatch':
        """At least one batch, one after the other."""
        columns = zip(*(vars(batch).values() for batch in batches), strict=True)
        return PoseBatch(*map(np.concatenate, columns))


class MotionLog:
    """Poses as received and trigger changes in the order in which they came.

    One thread may write while others read what is there already. Memory is bounded: at the limit
    the log closes, is no longer ``complete`` and forgets what it has.

    Args:
        limit_poses: poses to keep.
    """

    def __init__(self, limit_poses: int = DEFAULT_LIMIT_POSES) -> None:
        self.limit_poses = limit_poses
        self.poses = 0
        self.complete = True
        self.events: list[TriggerChange | PoseBatch] = []

    def add(self, event: TriggerChange | PoseBatch) -> None:
        """Note what came."""
        if not self.complete:
            return
        if isinstance(event, PoseBatch):
            self.poses += len(event)
        if self.poses > self.limit_poses:
            self.complete = False
            self.events = []
            return
        self.events.append(event)

    def first_poses(self, count: int) -> PoseBatch | None:
        """The first poses that are kept, at least ``count`` if there are so many."""
        batches, found = [], 0
        for event in self.events:
            if isinstance(event, PoseBatch):
                batches.append(event)
                found += len(event)
            if found >= count:
                break
        return PoseBatch.joined(batches) if batches else None


def merged(
    events: Iterable[TriggerChange | PoseBatch], poses: int = MERGED_POSES
) -> Iterator[TriggerChange | PoseBatch]:
    """The same events with poses that came in a row in batches of about so many."""
    waiting: list[PoseBatch] = []
    for event in events:
        if isinstance(event, PoseBatch):
            waiting.append(event)
            if sum(map(len, waiting)) < poses:
                continue
        if waiting:
            yield PoseBatch.joined(waiting)
            waiting = []
        if isinstance(event, TriggerChange):
            yield event
    if waiting:
        yield PoseBatch.joined(waiting)
