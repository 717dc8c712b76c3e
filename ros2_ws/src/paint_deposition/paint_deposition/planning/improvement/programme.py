"""A given motion as a path and the openings of the gun along it, to be timed anew."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from paint_deposition.errors import PlanError
from paint_deposition.motion.path_builder import DEFAULT_MAX_POSE_GAP_S, gap_ns
from paint_deposition.motion.pose_stream import PoseBatch, PoseScreen
from paint_deposition.motion.trajectory import Trajectory, numbered
from paint_deposition.motion.trigger import ONLY_BRUSH

# Intervals that travel less have no speed: the gun waits or turns.
STANDING_M = 1e-6
# The shortest time between two poses that is written [s].
LEAST_STEP_S = 1e-5
# Stamps begin here: in ROS a stamp of 0 is none.
BEGIN_NS = 1_000_000_000
# A measured flow that varies by less within an opening is taken as its mean.
STEADY_FLOW = 0.02


@dataclass(frozen=True)
class Opening:
    """A stretch of the path along which the gun is open.

    Attributes:
        on_m, off_m: travel of the TCP at which it opens and closes.
        flow: relative to the calibrated one.
        brush: number of the brush; 0 is the only one.
    """

    on_m: float
    off_m: float
    flow: float
    brush: int = ONLY_BRUSH


@dataclass(frozen=True)
class Programme:
    """The path of a motion, how long each piece of it takes, and where the gun is open.

    Attributes:
        positions_m: (N, 3) TCP at its poses, and quaternions_xyzw (N, 4).
        travel_m: (N,) length of the path up to each pose.
        duration_s: (N - 1,) time from each pose to the next.
        openings: in order, apart from each other.
        given: the motion that it was made from.
    """

    positions_m: np.ndarray
    quaternions_xyzw: np.ndarray
    travel_m: np.ndarray
    duration_s: np.ndarray
    openings: tuple[Opening, ...]
    given: Trajectory

    @staticmethod
    def of(trajectory: Trajectory, max_pose_gap_s: float = DEFAULT_MAX_POSE_GAP_S) -> 'Programme':
        """From a motion as recorded or programmed.

        Raises:
            PlanError: the gun never sprays on a move, or the recording starts anew in between.
        """
        screen = PoseScreen(gap_ns(max_pose_gap_s))
        batch = PoseBatch(
            np.asarray(trajectory.stamps_ns, np.int64),
            np.asarray(trajectory.positions_m, float),
            np.asarray(trajectory.quaternions_xyzw, float),
        )
        streams = screen.take(batch)
        if len(streams) > 1:
            raise PlanError(
                f'{trajectory.source}: its clock goes back {len(streams) - 1} times; give one run'
            )
        poses = streams[0]
        travel = np.concatenate(
            [[0.0], np.cumsum(np.linalg.norm(np.diff(poses.positions_m, axis=0), axis=1))]
        )
        seconds = (poses.stamps_ns - poses.stamps_ns[0]) * 1e-9
        programme = Programme(
            poses.positions_m, poses.quaternions_xyzw, travel, np.diff(seconds),
            _openings(trajectory, poses.stamps_ns, travel, gap_ns(max_pose_gap_s)), trajectory,
        )  # fmt: skip
        if not programme.openings:
            raise PlanError(f'{trajectory.source}: the gun never sprays on a move')
        return programme

    @cached_property
    def clock_s(self) -> np.ndarray:
        """(N,) time at each pose from the first [s]."""
        return np.concatenate([[0.0], np.cumsum(self.duration_s)])

    @cached_property
    def _rising_m(self) -> np.ndarray:
        """(N,) travel that rises where the gun stands, too: of its stay the last pose counts."""
        return self.travel_m + 1e-12 * np.arange(len(self.travel_m))

    def seconds_at(self, travel_m: np.ndarray) -> np.ndarray:
        """(...) time at which lengths of travel (...) are reached [s]."""
        return np.interp(travel_m, self._rising_m, self.clock_s)

    def travel_at_m(self, stamps_ns: np.ndarray) -> np.ndarray:
        """(...) travel at stamps (...) of its timed motion, see ``trajectory``."""
        return np.interp((stamps_ns - BEGIN_NS) * 1e-9, self.clock_s, self.travel_m)

    def positions_at_m(self, travel_m: np.ndarray) -> np.ndarray:
        """(n, 3) TCP at lengths of travel (n,)."""
        columns = [np.interp(travel_m, self._rising_m, column) for column in self.positions_m.T]
        return np.stack(columns, axis=1)

    @property
    def speed_m_per_s(self) -> np.ndarray:
        """(N - 1,) speed of the TCP from each pose to the next."""
        return np.diff(self.travel_m) / self.duration_s

    def with_openings(self, openings: tuple[Opening, ...]) -> 'Programme':
        """The same path with the gun open elsewhere."""
        return replace(self, openings=openings)

    def with_poses_at(self, travel_m: np.ndarray) -> 'Programme':
        """The same motion with poses at these lengths of travel too."""
        wanted = travel_m[(travel_m > 0.0) & (travel_m < self.travel_m[-1])]
        row = np.searchsorted(self.travel_m, wanted, side='right') - 1
        near = np.minimum(
            np.abs(wanted - self.travel_m[row]), np.abs(wanted - self.travel_m[row + 1])
        )
        wanted, row = wanted[near > STANDING_M], row[near > STANDING_M]
        if not len(wanted):
            return self
        share = (wanted - self.travel_m[row]) / (self.travel_m[row + 1] - self.travel_m[row])
        clock = self.clock_s
        seconds = clock[row] + share * self.duration_s[row]
        between = self.positions_m[row] + share[:, np.newaxis] * (
            self.positions_m[row + 1] - self.positions_m[row]
        )
        turns = Slerp(clock, Rotation.from_quat(self.quaternions_xyzw))(seconds).as_quat()
        order = np.argsort(np.concatenate([clock, seconds]), kind='stable')
        return replace(
            self,
            positions_m=np.concatenate([self.positions_m, between])[order],
            quaternions_xyzw=np.concatenate([self.quaternions_xyzw, turns])[order],
            travel_m=np.concatenate([self.travel_m, wanted])[order],
            duration_s=np.diff(np.concatenate([clock, seconds])[order]),
        )

    def without_standstill(self) -> 'Programme':
        """Without poses that are reached in no time: the gun stood there and does so no more."""
        kept = np.append(True, self.duration_s > LEAST_STEP_S)
        return replace(
            self,
            positions_m=self.positions_m[kept],
            quaternions_xyzw=self.quaternions_xyzw[kept],
            travel_m=self.travel_m[kept],
            duration_s=self.duration_s[kept[1:]],
        )

    def trajectory(self) -> Trajectory:
        """The timed motion; the gun opens and closes at poses."""
        whole = self.with_poses_at(np.array([[o.on_m, o.off_m] for o in self.openings]).ravel())
        clock = whole.clock_s
        stamps = BEGIN_NS + np.round(clock * 1e9).astype(np.int64)
        triggers, flows, brushes = [], [], []
        for opening in self.openings:
            # Standing at either end is outside.
            on = np.interp(opening.on_m + STANDING_M, whole.travel_m, clock)
            off = np.interp(opening.off_m - STANDING_M, whole.travel_m, clock)
            triggers += [BEGIN_NS + round(on * 1e9), BEGIN_NS + round(off * 1e9)]
            flows += [opening.flow, 0.0]
            brushes += [opening.brush] * 2
        return replace(
            self.given,
            stamps_ns=stamps,
            positions_m=whole.positions_m,
            quaternions_xyzw=whole.quaternions_xyzw,
            trigger_stamps_ns=np.array(triggers, np.int64),
            trigger_flow=np.array(flows),
            trigger_brush=numbered(brushes),
        )


def speed_along(programme: Programme, travel_m: np.ndarray) -> np.ndarray:
    """(N - 1,) mean speed between places (N,) of the path [m/s]."""
    return np.diff(travel_m) / np.maximum(np.diff(programme.seconds_at(travel_m)), 1e-9)


def _openings(
    trajectory: Trajectory, stamps_ns: np.ndarray, travel_m: np.ndarray, max_gap_ns: int
) -> tuple[Opening, ...]:
    """Where the gun is open on the way; gaps between poses close it."""
    changes = {stamp: (flow, brush) for stamp, flow, brush in trajectory.triggers}
    if not changes:
        changes = {int(stamps_ns[0]): (1.0, ONLY_BRUSH)}
    first, last = int(stamps_ns[0]), int(stamps_ns[-1])
    times = sorted(changes)
    ends = [*times[1:], last]
    spans: list[tuple[int, int, float, int]] = [
        (max(begin, first), min(end, last), *changes[begin])
        for begin, end in zip(times, ends, strict=True)
        if changes[begin][0] > 0.0 and min(end, last) > max(begin, first)
    ]
    gaps = np.flatnonzero(np.diff(stamps_ns) > max_gap_ns)
    for gap in gaps.tolist():
        a, b = int(stamps_ns[gap]), int(stamps_ns[gap + 1])
        spans = [
            piece
            for begin, end, flow, brush in spans
            for piece in ((begin, min(end, a), flow, brush), (max(begin, b), end, flow, brush))
            if piece[1] > piece[0]
        ]
    merged: list[list[tuple[int, int, float, int]]] = []
    for span in spans:
        goes_on = merged and merged[-1][-1][1] == span[0] and merged[-1][-1][3] == span[3]
        if goes_on:
            merged[-1].append(span)
        else:
            merged.append([span])
    openings = []
    for pieces in merged:
        at = np.interp([pieces[0][0], pieces[-1][1]], stamps_ns, travel_m)
        seconds = np.array([end - begin for begin, end, *_ in pieces], float)
        flow = float(np.average([flow for *_, flow, _ in pieces], weights=seconds))
        if at[1] - at[0] > STANDING_M:
            openings.append(Opening(float(at[0]), float(at[1]), flow, pieces[0][3]))
    return tuple(openings)
