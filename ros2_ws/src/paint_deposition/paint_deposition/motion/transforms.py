"""Rigid transforms: the part in the frame of the poses, and frames in one another over time.

Frames follow the rules of tf2, live and from a recording.
"""

from bisect import bisect_left, bisect_right
from collections import ChainMap
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from operator import itemgetter, matmul
from typing import Any

import numpy as np

from paint_deposition.motion.path import write_rotation
from paint_deposition.motion.trajectory import Trajectory

# On which painting nodes say where the part stands.
PART_POSE_TOPIC = 'part_pose'


def is_frame(frame_id: str, own: str) -> bool:
    """Whether poses in a frame are in one's own: it is the same, or none is named."""
    return frame_id.lstrip('/') in ('', own.lstrip('/'))


@dataclass(frozen=True)
class Rigid:
    """A rotation (3, 3) with its quaternion (x, y, z, w), and then a translation (3,) [m]."""

    rotation: np.ndarray
    quaternion_xyzw: tuple[float, float, float, float]
    translation_m: np.ndarray

    @staticmethod
    def of(values: Sequence[float] | np.ndarray) -> 'Rigid':
        """From [x y z qx qy qz qw]; the quaternion is normalised."""
        quaternion = np.asarray(values[3:], dtype=float)
        x, y, z, w = (quaternion / np.linalg.norm(quaternion)).tolist()
        rotation = np.empty((3, 3))
        write_rotation(rotation, (x, y, z, w))
        return Rigid(rotation, (x, y, z, w), np.asarray(values[:3], dtype=float))

    def inverse(self) -> 'Rigid':
        """The inverse transform."""
        x, y, z, w = self.quaternion_xyzw
        back = self.rotation.T
        return Rigid(back, (-x, -y, -z, w), -back @ self.translation_m)

    def __matmul__(self, first: 'Rigid') -> 'Rigid':
        """The transform that does the other one first, and then this one."""
        position, quaternion = self.applied(first.translation_m, np.array(first.quaternion_xyzw))
        return Rigid.of([*position, *quaternion])

    @property
    def values(self) -> tuple[float, ...]:
        """The transform as [x y z qx qy qz qw]."""
        return (*self.translation_m.tolist(), *self.quaternion_xyzw)

    def applied(self, positions_m: np.ndarray, quaternions_xyzw: np.ndarray) -> tuple:
        """Poses after the transform: positions (..., 3) and quaternions (..., 4) of unchanged
        norm.

        Each pose by itself, so that it comes out the same to the last bit alone or among others.
        """
        turned = np.sum(self.rotation * positions_m[..., np.newaxis, :], axis=-1)
        x, y, z, w = self.quaternion_xyzw
        qx, qy, qz, qw = np.moveaxis(quaternions_xyzw, -1, 0)
        quaternions = (
            w * qx + x * qw + y * qz - z * qy,
            w * qy - x * qz + y * qw + z * qx,
            w * qz + x * qy - y * qx + z * qw,
            w * qw - x * qx - y * qy - z * qz,
        )
        return turned + self.translation_m, np.stack(quaternions, axis=-1)


def at_part(trajectory: Trajectory, part_pose: Sequence[float], frame_id: str) -> Trajectory:
    """A motion in the frame of the part, which stands at ``part_pose`` in that of the poses."""
    return moved(trajectory, Rigid.of(part_pose).inverse(), frame_id)


def moved(trajectory: Trajectory, transform: Rigid, frame_id: str) -> Trajectory:
    """A motion after a transform that brings its poses into a frame of that name."""
    positions, quaternions = transform.applied(trajectory.positions_m, trajectory.quaternions_xyzw)
    return replace(
        trajectory, positions_m=positions, quaternions_xyzw=quaternions, frame_id=frame_id
    )


# Where a frame was between two transforms that are further apart is not known. A live pose waits
# as long for its transform, so that a recording has the same poses as the nodes had.
LONGEST_GAP_NS = 2_000_000_000
# A sample that is older than the newest by more is late; two in a row are of a restarted stream.
# One without a stamp among those of a clock begins nothing; stamps from here on, of the year 2001,
# are of a clock and not of a simulation that began at 0.
FAR_BEHIND_NS, CLOCK_NS = 1_000_000_000, 1_000_000_000_000_000_000
STAMP = itemgetter(0)


def _is_far_behind(stamp_ns: Any, newest_ns: Any) -> Any:
    """Whether samples, one or (N,), are late, or of a restarted stream."""
    of_one_clock = (stamp_ns > 0) | (newest_ns < CLOCK_NS)
    return (stamp_ns < newest_ns - FAR_BEHIND_NS) & of_one_clock


def began_again(stamps_ns: np.ndarray) -> int | None:
    """The row of samples, stamps (N,) as they came, in which a restarted stream is known."""
    behind = _is_far_behind(stamps_ns, np.maximum.accumulate(stamps_ns))
    again = behind[:-1] & behind[1:] & (np.diff(stamps_ns) > 0)
    return int(np.argmax(again)) if again.any() else None


class NoTransform(Exception):
    """There is no transform, though with `may_come` there may be one later."""

    def __init__(self, reason: str, may_come: bool = False) -> None:
        super().__init__(reason)
        self.may_come = may_come


class FrameTree:
    """Frames, each with its pose in its parent, fixed or over time.

    Args:
        live: poses over time come in order, and are remembered for ten seconds.
    """

    def __init__(self, live: bool = False) -> None:
        self._live = live
        # Parent and pose of a frame that does not move; of these, where the user says that it is.
        self._fixed: dict[str, tuple[str, Rigid]] = {}
        self._placed: dict[str, tuple[str, Rigid]] = {}
        # Both, the user's in the place of the others.
        self._still = ChainMap(self._placed, self._fixed)
        # Stamp, parent and pose of each frame over time, in order; and of a live one that the
        # last transform was far behind.
        self._moving: dict[str, list[tuple[int, str, np.ndarray]]] = {}
        self._behind: dict[str, tuple[int, str, np.ndarray]] = {}
        # Transforms that hold at any time.
        self._lasting: dict[tuple[str, str], Rigid] = {}

    @property
    def names(self) -> list[str]:
        """All frames, by name."""
        parents = {parent for parent, _ in self._still.values()}
        parents |= {parent for motion in self._moving.values() for _, parent, _ in motion}
        return sorted(parents | self._still.keys() | self._moving.keys())

    def fix(self, child: str, parent: str, pose: Sequence[float]) -> None:
        """Take a static transform, which replaces earlier ones of the frame."""
        if self._has_room(child):
            self._lasting.clear()
            self._fixed[_name(child)] = _name(parent), Rigid.of(pose)

    def place(self, child: str, parent: str, pose: Sequence[float]) -> None:
        """Say where a frame is, whatever transforms say of it; no pose: they say it again."""
        self._lasting.clear()
        self._placed.pop(_name(child), None)
        if len(pose):
            self._placed[_name(child)] = _name(parent), Rigid.of(pose)

    def add(self, child: str, parent: str, stamp_ns: int, pose: Sequence[float]) -> bool:
        """Take a transform at one time.

        Returns:
            Whether a live stream began again: poses over time from before it are forgotten.
        """
        if not self._has_room(child):
            return False
        name, newest_ns = _name(child), self.newest_ns(child)
        entry = stamp_ns, _name(parent), np.array(pose, dtype=float)
        is_behind = self._live and _is_far_behind(stamp_ns, newest_ns)
        before = self._behind.pop(name, None)
        restarted = False
        if is_behind and before is not None and before[0] < stamp_ns:
            restarted = True
            self._moving.clear()
            self._moving[name] = [before]
        elif is_behind:
            self._behind[name] = entry
        if name not in self._moving:
            self._lasting.clear()
        motion = self._moving.setdefault(name, [])
        row = bisect_left(motion, stamp_ns, key=STAMP)
        is_known = row < len(motion) and motion[row][0] == stamp_ns
        motion[row : row + is_known] = [entry]
        if self._live:
            # As in tf2 [ns], and no more poses than any cell has.
            old = bisect_left(motion, motion[-1][0] - 10_000_000_000, key=STAMP)
            del motion[: max(old, len(motion) - 100_000)]
        return restarted

    def _has_room(self, child: str) -> bool:
        known = self._fixed.keys() | self._moving.keys()
        return _name(child) in known or len(known) < 1000

    def placed(self, child: str) -> tuple[str, Rigid] | None:
        """Parent and pose of a frame that does not move, None if it does or is not known."""
        return self._still.get(_name(child))

    def newest_ns(self, child: str) -> int:
        """Stamp of the newest pose of a frame over time, 0 without any."""
        motion = self._moving.get(_name(child))
        return motion[-1][0] if motion else 0

    def stamps_ns(self, child: str) -> list[int]:
        """The stamps of the poses of a frame over time."""
        return [stamp for stamp, *_ in self._moving[_name(child)]]

    def _up(self, one: str, other: str, stamp_ns: int) -> tuple[list[str], list[str]]:
        """The frames from either up to, and without, the first that both are in."""
        chains, still = ([_name(one)], [_name(other)]), self._still
        for chain in chains:
            while len(chain) <= len(still) + len(self._moving):
                if chain[-1] in still:
                    chain.append(still[chain[-1]][0])
                elif chain[-1] in self._moving:
                    motion = self._moving[chain[-1]]
                    at_or_before = bisect_right(motion, stamp_ns, key=STAMP) - 1
                    chain.append(motion[max(at_or_before, 0)][1])
                else:
                    break
        shared = next((frame for frame in chains[0] if frame in chains[1]), None)
        if shared is None:
            raise NoTransform(f"no transforms connect '{one}' to '{other}'", may_come=True)
        up, down = (chain[: chain.index(shared)] for chain in chains)
        return up, down

    def moving_between(self, one: str, other: str, stamp_ns: int = 0) -> set[str] | None:
        """The frames between two that move in their parents; None if they are not connected."""
        try:
            up, down = self._up(one, other, stamp_ns)
        except NoTransform:
            return None
        return {*up, *down} & self._moving.keys() - self._still.keys()

    def lookup(self, source: str, target: str, stamp_ns: int = 0) -> Rigid:
        """The pose of frame `source` in `target` at that time, which brings poses from one to
        the other.

        Raises:
            NoTransform: it is not known, or not yet.
        """
        if lasting := self._lasting.get((source, target)):
            return lasting
        up, down = self._up(source, target, stamp_ns)
        placed, back = self._product(up, stamp_ns), self._product(down, stamp_ns)
        if back is not None:
            placed = back.inverse() @ placed if placed else back.inverse()
        found = placed or Rigid.of([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        if not self.moving_between(source, target, stamp_ns):
            self._lasting[source, target] = found
        return found

    def _product(self, chain: list[str], stamp_ns: int) -> Rigid | None:
        """The pose of the first frame of a chain in the parent of the last."""
        still = self._still
        steps = [
            still[frame][1] if frame in still else self._pose_at(frame, stamp_ns)
            for frame in chain
        ]
        return reduce(matmul, reversed(steps)) if steps else None

    def _pose_at(self, frame: str, stamp_ns: int) -> Rigid:
        """In its parent, interpolated between the transforms before and after."""
        from pytransform3d.rotations import quaternion_slerp

        motion = self._moving[frame]
        row = bisect_left(motion, stamp_ns, key=STAMP)
        if row < len(motion) and motion[row][0] == stamp_ns:
            return Rigid.of(motion[row][2])
        of = f"the pose of '{frame}' at {1e-9 * stamp_ns:.3f} s is not known"
        if row == len(motion):
            raise NoTransform(f'{of}: the newest of tf is of {1e-9 * motion[-1][0]:.3f} s', True)
        if row == 0:
            raise NoTransform(f'{of}: the first of tf is of {1e-9 * motion[0][0]:.3f} s')
        (begin_ns, parent, before), (end_ns, next_parent, after) = motion[row - 1 : row + 1]
        if end_ns - begin_ns > LONGEST_GAP_NS:
            raise NoTransform(f'{of}: tf has none for {1e-9 * (end_ns - begin_ns):.2f} s')
        if parent != next_parent:
            return Rigid.of(before)
        share = (stamp_ns - begin_ns) / (end_ns - begin_ns)
        pose = (1.0 - share) * before + share * after
        if not np.array_equal(before[3:], after[3:]):
            pose[3:] = quaternion_slerp(before[3:], after[3:], share, shortest_path=True)
        return Rigid.of(pose)


def _name(frame: str) -> str:
    return frame.lstrip('/')
