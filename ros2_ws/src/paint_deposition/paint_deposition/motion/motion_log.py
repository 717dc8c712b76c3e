"""What came of a stream of poses and trigger changes, kept so that it can be followed again."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from paint_deposition.motion.trigger import ONLY_BRUSH

# Two hours at 250 Hz, 64 bytes a pose.
DEFAULT_LIMIT_POSES = 2_000_000
BLOCK_POSES = 4096
# As many at once as are followed without a thread that waits being kept waiting.
BATCH_POSES = 256


@dataclass(frozen=True)
class TriggerChange:
    """The flow (relative; 0 is gun off) from a time on, and the number of the brush.

    ``set_points`` are a row of those of a trajectory, or none.
    """

    stamp_ns: int
    flow: float
    brush: int = ONLY_BRUSH
    set_points: tuple[float, ...] = ()


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

    The poses lie close together, whatever batches they came in. One thread may write while others
    read what is there already. Memory is bounded: at the limit the log closes, is no longer
    ``complete`` and forgets what it has.

    Args:
        limit_poses: poses to keep.

    Attributes:
        poses, changes: how many came.
    """

    def __init__(self, limit_poses: int = DEFAULT_LIMIT_POSES) -> None:
        self.limit_poses = limit_poses
        self.poses = 0
        self.complete = True
        self._blocks: list[PoseBatch] = []
        # With the number of poses that came before.
        self._changes: list[tuple[int, TriggerChange]] = []

    @property
    def changes(self) -> int:
        return len(self._changes)

    def add(self, event: TriggerChange | PoseBatch) -> None:
        """Note what came."""
        if not self.complete:
            return
        if isinstance(event, TriggerChange):
            self._changes.append((self.poses, event))
            return
        if self.poses + len(event) > self.limit_poses:
            self.complete = False
            self._blocks, self._changes = [], []
        else:
            self._pack(event)
        self.poses += len(event)

    def events(self, poses: int = 0, changes: int = 0) -> Iterator[TriggerChange | PoseBatch]:
        """What came until now, after so many poses and changes."""
        blocks, end = self._blocks, self.poses
        if not self.complete:
            return
        for before, change in self._changes[changes:]:
            if before > end:
                break
            yield from _rows(blocks, poses, before)
            yield change
            poses = before
        yield from _rows(blocks, poses, end)

    def first_poses(self, count: int) -> PoseBatch | None:
        """The first poses that are kept, ``count`` if there are so many."""
        batches = list(_rows(self._blocks, 0, min(count, self.poses if self.complete else 0)))
        return PoseBatch.joined(batches) if batches else None

    def _pack(self, batch: PoseBatch) -> None:
        taken = 0
        while taken < len(batch):
            row = (self.poses + taken) % BLOCK_POSES
            if row == 0:
                shapes = ((BLOCK_POSES,), (BLOCK_POSES, 3), (BLOCK_POSES, 4))
                kinds = (np.int64, np.float64, np.float64)
                self._blocks.append(PoseBatch(*map(np.empty, shapes, kinds)))
            count = min(BLOCK_POSES - row, len(batch) - taken)
            part = batch.select(slice(taken, taken + count))
            columns = zip(vars(self._blocks[-1]).values(), vars(part).values(), strict=True)
            for kept, new in columns:
                kept[row : row + count] = new
            taken += count


def _rows(blocks: list[PoseBatch], start: int, stop: int) -> Iterator[PoseBatch]:
    """The poses of this range."""
    while start < stop:
        block, row = divmod(start, BLOCK_POSES)
        end = min(row + BATCH_POSES, row + stop - start, BLOCK_POSES)
        yield blocks[block].select(slice(row, end))
        start += end - row
