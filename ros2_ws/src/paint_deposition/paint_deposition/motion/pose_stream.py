"""A stream of poses and trigger changes: which can be followed, and a log to follow it again."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from paint_deposition.motion.stream_quality import RepeatedSamples
from paint_deposition.motion.trajectory import ONLY_BRUSH, PoseCounts, Trajectory
from paint_deposition.request import QUATERNION_TOLERANCE

# Two hours at 250 Hz, 64 bytes a pose.
DEFAULT_POSE_MEMORY = 2_000_000
# So few at once that other threads have their turn in between.
BATCH_POSES = 256


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

    @staticmethod
    def of(
        stamps_ns: ArrayLike, positions_m: ArrayLike, quaternions_xyzw: ArrayLike
    ) -> 'PoseBatch':
        """From any numbers of these shapes."""
        stamps = np.asarray(stamps_ns, np.int64)
        return PoseBatch(
            stamps, np.asarray(positions_m, float), np.asarray(quaternions_xyzw, float)
        )

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def select(self, rows: slice | list[int] | np.ndarray) -> 'PoseBatch':
        """The chosen rows."""
        chosen = rows if isinstance(rows, slice) else np.asarray(rows, dtype=np.int64)
        return PoseBatch(*(column[chosen] for column in vars(self).values()))

    @property
    def finite(self) -> np.ndarray:
        """(N,) whether the numbers of a pose are, and no further away than any part."""
        turned = (np.abs(self.quaternions_xyzw) <= FARTHEST_M).all(axis=1)
        return turned & (np.abs(self.positions_m) <= FARTHEST_M).all(axis=1)

    def finite_axes(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions (M, 3) [m] and tool z (M, 3) of the poses that are finite."""
        finite = self.finite
        x, y, z, w = self.quaternions_xyzw[finite].T
        axes = [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)]
        return self.positions_m[finite], np.stack(axes, axis=1)

    @staticmethod
    def joined(batches: list['PoseBatch']) -> 'PoseBatch':
        """At least one batch, one after the other."""
        columns = zip(*(vars(batch).values() for batch in batches), strict=True)
        return PoseBatch(*map(np.concatenate, columns))

    @property
    def speed_m_per_s(self) -> float:
        """Way of the TCP over time [m/s]; NaN while there are no two times."""
        if len(self) < 2 or self.stamps_ns[-1] <= self.stamps_ns[0]:
            return math.nan
        way_m = np.linalg.norm(np.diff(self.positions_m, axis=0), axis=1).sum()
        return float(way_m / (1e-9 * (self.stamps_ns[-1] - self.stamps_ns[0])))


NO_POSES = PoseBatch(np.empty(0, np.int64), np.empty((0, 3)), np.empty((0, 4)))


def newest_poses(before: PoseBatch, poses: PoseBatch) -> PoseBatch:
    """Those of the last 0.2 s after some more; stamps that go back begin anew."""
    if not len(before) or poses.stamps_ns[0] > before.stamps_ns[-1]:
        poses = PoseBatch.joined([before, poses])
    # Single steps carry the noise of the encoders and the jitter of the stamps.
    recent = np.flatnonzero(poses.stamps_ns >= poses.stamps_ns[-1] - 200_000_000)
    return poses.select(recent[-2000:])


def events_of(
    motion: Trajectory, after: int = -1, until: int | None = None
) -> Iterator[TriggerChange | PoseBatch]:
    """The poses and the trigger changes of a recorded motion in the order in which they came.

    The first change comes first: it says how the gun was before it. Of a part of the motion, what
    came after so many poses, ``until`` as many were there.
    """
    batch = PoseBatch.of(motion.stamps_ns, motion.positions_m, motion.quaternions_xyzw)
    begin, end = max(after, 0), len(motion) if until is None else until
    came = np.zeros(len(motion.trigger_flow), np.int64)
    came[1:] = motion.trigger_rows[1:] if len(motion.trigger_rows) else 0
    for row, change in zip(came.tolist(), motion.triggers, strict=True):
        if after < row <= end:
            if row > begin:
                yield batch.select(slice(begin, row))
                begin = row
            yield TriggerChange(*change)
    if begin < end:
        yield batch.select(slice(begin, end))


class MotionLog:
    """Poses as received and trigger changes in the order in which they came.

    One thread may write while others read what is there already. Memory is bounded: beyond
    ``pose_memory`` the log closes, is no longer ``complete`` and forgets what it has.

    Attributes:
        poses, changes: how many came.
    """

    def __init__(self, pose_memory: int = DEFAULT_POSE_MEMORY) -> None:
        self.pose_memory = pose_memory
        self.poses = self.changes = 0
        self.complete = True
        self._events: list[TriggerChange | PoseBatch] = []

    def add(self, event: TriggerChange | PoseBatch) -> None:
        """Note what came."""
        poses, changes = (0, 1) if isinstance(event, TriggerChange) else (len(event), 0)
        if not self.complete or self.poses + self.changes + poses + changes > self.pose_memory:
            self.complete, self._events = False, []
            return
        self._events.append(event)
        self.poses += poses
        self.changes += changes

    def events(self, poses: int = 0, changes: int = 0) -> Iterator[TriggerChange | PoseBatch]:
        """What came until now, after so many poses and changes."""
        for event in [*self._events]:  # more may come meanwhile
            if isinstance(event, TriggerChange):
                if changes <= 0:
                    yield event
                changes -= 1
            else:
                for row in range(max(poses, 0), len(event), BATCH_POSES):
                    yield event.select(slice(row, row + BATCH_POSES))
                poses -= len(event)


# A number beyond this is damage too, and its square must be one in single precision [m].
FARTHEST_M = 1e6


class PoseScreen:
    """Drops and counts poses with a repeated or backward stamp, a non-finite number or a
    quaternion that is no rotation, and a driver's repeats; notices gaps and restarted streams.

    Poses with stamps before the newest one wait ``behind``. A few of them are stragglers and are
    dropped when the stream continues; a run of them that is longer than a gap is the stream
    restarted, and none of it is lost. More than ``max_gap_ns`` between two poses is a gap.
    """

    def __init__(self, max_gap_ns: int) -> None:
        self.max_gap_ns = max_gap_ns
        self.counts = PoseCounts()
        self.newest_ns: int | None = None
        self.behind = NO_POSES
        self._repeats = RepeatedSamples()

    def take(self, poses: PoseBatch) -> list[PoseBatch]:
        """Screen poses; what comes back has strictly increasing stamps and unit quaternions.

        The first batch continues those before; each further one is a restarted stream.
        """
        poses = PoseBatch.joined([self.behind, self._rotations(poses)])
        streams: list[list[int]] = [[]]
        behind: list[int] = []
        stamps = poses.stamps_ns.tolist()
        for row, stamp in enumerate(stamps):
            if self.newest_ns is None or stamp > self.newest_ns:
                self.counts.backward_stamps += len(behind)
                behind = []
                self._step_to(stamp)
                streams[-1].append(row)
            elif stamp == self.newest_ns or (behind and stamp == stamps[behind[-1]]):
                self.counts.repeated_stamps += 1
            # 10,000 within a gap are no stream.
            elif (behind and stamp < stamps[behind[-1]]) or len(behind) >= 10_000:
                self.counts.backward_stamps += len(behind)
                behind = [row]
            else:
                behind.append(row)
                lasting = stamp - stamps[behind[0]] > self.max_gap_ns
                # So many poses in order, over more than a gap, are no stragglers: the stream was
                # restarted.
                if lasting and len(behind) >= 3:
                    self.counts.restarts += 1
                    self.newest_ns = None
                    for waited in behind:
                        self._step_to(stamps[waited])
                    streams.append(behind)
                    behind = []
        self.behind = poses.select(behind)
        return [poses.select(rows) for rows in streams]

    def finish(self) -> None:
        """The stream has ended: what still waits is dropped."""
        self.counts.backward_stamps += len(self.behind)
        self.behind = NO_POSES

    def _rotations(self, poses: PoseBatch) -> PoseBatch:
        quaternions = poses.quaternions_xyzw
        finite = poses.finite
        norms = np.sqrt((np.where(finite[:, np.newaxis], quaternions, 0.0) ** 2).sum(axis=1))
        unit = np.abs(norms - 1.0) <= QUATERNION_TOLERANCE
        self.counts.received += len(poses)
        self.counts.not_finite += int(np.count_nonzero(~finite))
        self.counts.not_unit_quaternions += int(np.count_nonzero(finite & ~unit))
        good = finite & unit
        rotations = quaternions[good] / norms[good, np.newaxis]
        kept = PoseBatch(poses.stamps_ns[good], poses.positions_m[good], rotations)
        new = self._repeats.are_new(kept.stamps_ns, np.hstack([kept.positions_m, rotations]))
        self.counts.repeated_samples = self._repeats.count
        return kept if new.all() else kept.select(np.flatnonzero(new))

    def _step_to(self, stamp_ns: int) -> None:
        if self.newest_ns is not None and stamp_ns - self.newest_ns > self.max_gap_ns:
            self.counts.gaps += 1
            gap_ns = stamp_ns - self.newest_ns
            self.counts.longest_gap_ns = max(self.counts.longest_gap_ns, gap_ns)
        self.newest_ns = stamp_ns
