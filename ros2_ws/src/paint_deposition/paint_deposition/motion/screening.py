"""Which poses of a stream can be followed."""

import numpy as np

from paint_deposition.motion.motion_log import PoseBatch
from paint_deposition.motion.trajectory import PoseCounts

# RAPID writes quaternions with four digits; further off is damage, not rounding.
QUATERNION_TOLERANCE = 0.01
# A number beyond this is damage too, and its square must be one in single precision [m].
FARTHEST_M = 1e6
# So many poses in order, over more than a gap, are no stragglers: the stream was restarted.
FEWEST_OF_A_RESTART = 3


class PoseScreen:
    """Drops and counts poses with a repeated or backward stamp, a non-finite number or a
    quaternion that is no rotation; notices gaps and restarted streams.

    Poses with stamps before the newest one wait. A few of them are stragglers and are dropped
    when the stream goes on; a run of them that is longer than a gap is the stream restarted, and
    none of it is lost.

    Args:
        max_gap_ns: a longer time between two poses is a gap [ns].
    """

    def __init__(self, max_gap_ns: int) -> None:
        self.max_gap_ns = max_gap_ns
        self.counts = PoseCounts()
        self.newest_ns: int | None = None
        self._behind = PoseBatch(np.empty(0, dtype=np.int64), np.empty((0, 3)), np.empty((0, 4)))

    def take(self, poses: PoseBatch) -> list[PoseBatch]:
        """Screen poses.

        Returns:
            What to follow, stamps strictly increasing and quaternions of unit length. The first
            batch goes on from those before; each further one is a restarted stream.
        """
        poses = PoseBatch.joined([self._behind, self._rotations(poses)])
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
            elif behind and stamp < stamps[behind[-1]]:
                self.counts.backward_stamps += len(behind)
                behind = [row]
            else:
                behind.append(row)
                lasting = stamp - stamps[behind[0]] > self.max_gap_ns
                if lasting and len(behind) >= FEWEST_OF_A_RESTART:
                    self.counts.restarts += 1
                    self.newest_ns = None
                    for waited in behind:
                        self._step_to(stamps[waited])
                    streams.append(behind)
                    behind = []
        self._behind = poses.select(behind)
        return [poses.select(rows) for rows in streams]

    def finish(self) -> None:
        """The stream has ended: what still waits is dropped."""
        self.counts.backward_stamps += len(self._behind)
        self._behind = self._behind.select([])

    def _rotations(self, poses: PoseBatch) -> PoseBatch:
        quaternions = poses.quaternions_xyzw
        placed = (np.abs(poses.positions_m) <= FARTHEST_M).all(axis=1)
        finite = placed & np.isfinite(quaternions).all(axis=1)
        norms = np.sqrt((quaternions**2).sum(axis=1))
        unit = np.abs(norms - 1.0) <= QUATERNION_TOLERANCE
        self.counts.received += len(poses)
        self.counts.not_finite += int(np.count_nonzero(~finite))
        self.counts.not_unit_quaternions += int(np.count_nonzero(finite & ~unit))
        good = finite & unit
        rotations = quaternions[good] / norms[good, np.newaxis]
        return PoseBatch(poses.stamps_ns[good], poses.positions_m[good], rotations)

    def _step_to(self, stamp_ns: int) -> None:
        if self.newest_ns is not None and stamp_ns - self.newest_ns > self.max_gap_ns:
            self.counts.gaps += 1
            gap_ns = stamp_ns - self.newest_ns
            self.counts.longest_gap_ns = max(self.counts.longest_gap_ns, gap_ns)
        self.newest_ns = stamp_ns
