"""A given motion as a path and the openings of the gun along it, to be retimed; its moves."""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation, Slerp

from paint_deposition.errors import PaintError
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.motion.pose_stream import PoseBatch, PoseScreen
from paint_deposition.motion.programmed import Move
from paint_deposition.motion.trajectory import DEFAULT_MAX_POSE_GAP_S, Trajectory, gap_ns
from paint_deposition.part.surface import Surface
from paint_deposition.planning.requests import ImproveRequest

# Intervals that travel less have no speed: the gun waits or turns.
STANDING_M = 1e-6
# Stamps begin here: in ROS a stamp of 0 is none.
BEGIN_NS = 1_000_000_000


@dataclass(frozen=True)
class Programme:
    """The path of a motion, how long each piece of it takes, and where the gun is open."""

    positions_m: np.ndarray  # (N, 3) TCP at its poses, and quaternions_xyzw (N, 4)
    quaternions_xyzw: np.ndarray
    travel_m: np.ndarray  # (N,) length of the path up to each pose
    duration_s: np.ndarray  # (N - 1,) time from each pose to the next
    # Stretches along which the gun is open, in order, apart from each other.
    ends_m: np.ndarray  # (k, 2) travel at which it opens and closes
    flow: np.ndarray  # (k,) relative to the calibrated one
    brush: np.ndarray  # (k,) number of the brush; 0 is the only one
    original: Trajectory  # the motion that it was made from
    # Travels and the speeds that the joints of a robot allow there; None: any.
    allowed: tuple[np.ndarray, np.ndarray] | None = None

    @staticmethod
    def of(trajectory: Trajectory, max_pose_gap_s: float = DEFAULT_MAX_POSE_GAP_S) -> 'Programme':
        """From a motion as recorded or programmed.

        Gaps between poses close the gun. Flows that change while it is open are taken as their
        mean over time.

        Raises:
            PaintError: the gun never sprays on a move, or its clock goes back in between.
        """
        batch = PoseBatch.of(
            trajectory.stamps_ns, trajectory.positions_m, trajectory.quaternions_xyzw
        )
        poses, *restarted = PoseScreen(gap_ns(max_pose_gap_s)).take(batch)
        if restarted:
            raise PaintError(
                f'{trajectory.source}: its clock goes back {len(restarted)} times; give one run'
            )
        steps_m = np.linalg.norm(np.diff(poses.positions_m, axis=0), axis=1)
        travel = np.append(0.0, np.cumsum(steps_m))
        since_ns = poses.stamps_ns - poses.stamps_ns[0]
        path, _ = spray_path(trajectory, max_pose_gap_s, whole_strokes=False)
        half_ns = np.rint(0.5e9 * path.dwell_s).astype(np.int64)
        edges_ns = np.stack([path.stamp_ns - half_ns, path.stamp_ns + half_ns])
        edges_ns -= poses.stamps_ns[0]
        on_m, off_m = np.interp(edges_ns, since_ns, travel)
        sprays = path.flow > 0.0
        breaks = (sprays[1:] != sprays[:-1]) | (path.brush[1:] != path.brush[:-1])
        # The halves of two sub-steps are rounded, each to a nanosecond.
        # Sub-steps this close in time follow each other.
        breaks |= edges_ns[0, 1:] - edges_ns[1, :-1] > 4
        openings = []
        for rows in filter(len, np.split(np.arange(len(path)), 1 + np.flatnonzero(breaks))):
            on, off = float(on_m[rows[0]]), float(off_m[rows[-1]])
            if sprays[rows[0]] and off - on > STANDING_M:
                flow = float(np.average(path.flow[rows], weights=path.dwell_s[rows]))
                openings.append((on, off, flow, int(path.brush[rows[0]])))
        if not openings:
            raise PaintError(f'{trajectory.source}: the gun never sprays on a move')
        *ends, flows, brushes = map(np.array, zip(*openings, strict=True))
        return Programme(
            poses.positions_m, poses.quaternions_xyzw, travel, np.diff(since_ns * 1e-9),
            np.stack(ends, axis=1), flows, brushes, trajectory,
        )  # fmt: skip

    @cached_property
    def clock_s(self) -> np.ndarray:
        """(N,) time at each pose from the first [s]."""
        return np.append(0.0, np.cumsum(self.duration_s))

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

    def speed_between(self, low_m: ArrayLike, high_m: ArrayLike) -> np.ndarray:
        """(n,) mean speed [m/s] between lengths of travel (n,), those beyond its ends left out."""
        low, high = np.maximum(low_m, 0.0), np.minimum(high_m, self.travel_m[-1])
        return (high - low) / np.maximum(self.seconds_at(high) - self.seconds_at(low), 1e-9)

    def turns_at_s(self, seconds: np.ndarray) -> Rotation:
        """Turns (n,) of the tool at times (n,) from the first pose."""
        return Slerp(self.clock_s, Rotation.from_quat(self.quaternions_xyzw))(seconds)

    @property
    def around_m(self) -> np.ndarray:
        """(k, 2) where the closed path before each opening begins, and that after it ends [m]."""
        ends = self.ends_m
        before, after = np.append(0.0, ends[:-1, 1]), np.append(ends[1:, 0], self.travel_m[-1])
        return np.stack([before, after], axis=1)

    def with_poses_at(self, travel_m: np.ndarray) -> 'Programme':
        """Insert poses at these lengths of travel; the motion stays as it is."""
        wanted = np.unique(travel_m[(travel_m > 0.0) & (travel_m < self.travel_m[-1])])
        wanted = wanted[np.diff(wanted, prepend=-1.0) > STANDING_M]
        row = np.searchsorted(self.travel_m, wanted, side='right') - 1
        before, after = self.travel_m[row], self.travel_m[row + 1]
        apart = np.minimum(np.abs(wanted - before), np.abs(wanted - after)) > STANDING_M
        if not apart.any():
            return self
        wanted, row = wanted[apart], row[apart]
        share = (wanted - before[apart]) / (after - before)[apart]
        clock, steps_m = self.clock_s, np.diff(self.positions_m, axis=0)
        seconds = clock[row] + share * self.duration_s[row]
        between = self.positions_m[row] + share[:, np.newaxis] * steps_m[row]
        turns = self.turns_at_s(seconds).as_quat()
        order = np.argsort(np.concatenate([clock, seconds]), kind='stable')
        return replace(
            self,
            positions_m=np.concatenate([self.positions_m, between])[order],
            quaternions_xyzw=np.concatenate([self.quaternions_xyzw, turns])[order],
            travel_m=np.concatenate([self.travel_m, wanted])[order],
            duration_s=np.diff(np.concatenate([clock, seconds])[order]),
        )

    def trajectory(self) -> Trajectory:
        """The timed motion; the gun opens and closes at poses."""
        whole = self.with_poses_at(self.ends_m.ravel())
        clock = whole.clock_s
        stamps = BEGIN_NS + np.round(clock * 1e9).astype(np.int64)
        # Standing at either end is outside.
        inside_m = self.ends_m + np.array([STANDING_M, -STANDING_M])
        switched_s = np.interp(inside_m.ravel(), whole.travel_m, clock)
        return replace(
            self.original,
            stamps_ns=stamps,
            positions_m=whole.positions_m,
            quaternions_xyzw=whole.quaternions_xyzw,
            trigger_stamps_ns=BEGIN_NS + np.round(switched_s * 1e9).astype(np.int64),
            trigger_flow=np.outer(self.flow, [1.0, 0.0]).ravel(),
            trigger_brush=np.repeat(self.brush, 2),
        )


def strokes_of(programme: Programme) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The straight stretches from turn to turn, numbered as a simulation of the programme does.

    Returned are (k, 2) the travel at which each begins and ends, (k,) the number of the pass that
    runs there or ran last, from 0, -1 before any, and (k,) bool whether a pass begins there:
    others are links.
    """
    path, _ = spray_path(programme.trajectory())
    begins = 1 + np.flatnonzero(np.diff(path.stroke))
    travel_m = programme.travel_at_m(path.stamp_ns)
    turns_m = travel_m[begins] - path.from_turn_m[begins]
    ends_m = np.concatenate([[0.0], turns_m, programme.travel_m[-1:]])
    # Turns and passes show a little behind their begin, and not both at once.
    middle = np.searchsorted(travel_m, 0.5 * (ends_m[1:] + ends_m[:-1]))
    number = path.spray_pass[np.minimum(middle, len(path) - 1)]
    return np.stack([ends_m[:-1], ends_m[1:]], axis=1), number, np.diff(number, prepend=-1) > 0


def closed_beside(programme: Programme, surface: Surface) -> Programme:
    """The programme with the gun closed in all links between passes that lie beside the part.

    Beside it is a link along which the tool's axis meets the part nowhere.
    """
    strokes_m, _, begins_pass = strokes_of(programme)
    ends_m = programme.ends_m
    cut_from: np.ndarray = np.arange(len(ends_m))
    # The gun is closed so far before a turn and opened so far behind it: their places are
    # estimates [m].
    turn = 0.02
    for begin, end in strokes_m[~begins_pass]:
        # Whether a link meets the part is looked at this often along it [m].
        places = np.linspace(begin, end, math.ceil((end - begin) / 0.01) + 2)[1:-1]
        axes = programme.turns_at_s(programme.seconds_at(places)).as_matrix()[:, :, 2]
        if (surface.first_faces(programme.positions_at_m(places), axes) < 0).all():
            # Of each opening what lies before the link, and what lies behind it.
            pieces_m = np.repeat(ends_m, 2, axis=0)
            pieces_m[::2, 1] = np.minimum(ends_m[:, 1], begin - turn)
            pieces_m[1::2, 0] = np.maximum(ends_m[:, 0], end + turn)
            kept = np.diff(pieces_m)[:, 0] > STANDING_M
            ends_m, cut_from = pieces_m[kept], np.repeat(cut_from, 2)[kept]
    flow, brush = programme.flow[cut_from], programme.brush[cut_from]
    return replace(programme, ends_m=ends_m, flow=flow, brush=brush)


def moves_of(programme: Programme, request: ImproveRequest) -> list[Move]:
    """Straight moves along a programme, from its first pose on.

    While the gun sprays, each move takes as long as the programme; else it has the programme's
    greatest speed on the way, so that the robot can reach the speed at which the gun opens.
    """
    ends, stops = programme.ends_m, []
    for on_m, off_m in ends:
        # Moves are neither too short in length nor in time; the speed is sampled so often.
        places = np.linspace(on_m, off_m, 401)
        speed = programme.speed_between(places[:-1], places[1:])
        least = np.maximum(request.move_min_m, speed / request.settings_per_s)
        count = np.append(0.0, np.cumsum(np.diff(places) / least))
        whole_moves = np.linspace(0.0, count[-1], max(2, int(count[-1]) + 1))
        stops.append(np.interp(whole_moves, count, places))
    stops_m = np.concatenate(stops)
    whole = programme.with_poses_at(stops_m)
    clock = whole.clock_s
    rows = _rows_to_stop_at(whole, stops_m)
    # The first move, to the first pose, is as fast as the way from there to the first opening.
    opened = max(rows[1], np.searchsorted(whole.travel_m, ends[0, 0] - STANDING_M))
    speed = np.append(np.diff(whole.travel_m) / whole.duration_s, 0.0)
    moves: list[Move] = []
    for before, row in zip([rows[0], *rows[:-1]], rows, strict=True):
        length = float(np.linalg.norm(whole.positions_m[row] - whole.positions_m[before]))
        turns = Rotation.from_quat(whole.quaternions_xyzw[[before, row]])
        turned = (turns[0].inv() * turns[1]).magnitude() > 1e-6
        if moves and length < STANDING_M and not turned:
            continue
        middle = 0.5 * (whole.travel_m[before] + whole.travel_m[row])
        number = int(np.searchsorted(ends[:, 0], middle, side='right')) - 1
        spraying = bool(moves) and number >= 0 and middle < ends[number, 1]
        if spraying:  # a stay where the gun opens is outside
            left = np.searchsorted(whole.travel_m, whole.travel_m[before] + STANDING_M) - 1
            pace = length / (clock[row] - clock[left])
        else:
            pace = float(speed[before : row if moves else opened].max())
        pace = max(round(pace / 1e-5) * 1e-5, 1e-3)  # a program's speeds have few digits
        pose = whole.positions_m[row], whole.quaternions_xyzw[row]
        flow = float(programme.flow[number]) if spraying else 1.0
        brush = int(programme.brush[max(number, 0)])
        moves.append(Move(*pose, pace, spraying, flow=flow, brush=brush))
    return moves


def _rows_to_stop_at(whole: Programme, stops_m: np.ndarray) -> np.ndarray:
    """Poses at the stops, and those without which straight moves would leave the path."""
    wanted = np.zeros(len(whole.travel_m), dtype=bool)
    wanted[[0, -1]] = True
    nearest = np.searchsorted(whole.travel_m, stops_m - STANDING_M)
    wanted[np.minimum(nearest, len(wanted) - 1)] = True
    # Moves are straight: the path leaves them by no more than this [m]. A turn of the tool counts
    # by what it does at this lever, the distance of a surface [m].
    tolerance, lever = 0.0005, 0.3
    axes = lever * Rotation.from_quat(whole.quaternions_xyzw).as_matrix()
    followed = np.concatenate([whole.positions_m, axes[:, :, 0], axes[:, :, 2]], axis=1)
    anchors = np.flatnonzero(wanted)
    spans = list(zip(anchors[:-1].tolist(), anchors[1:].tolist(), strict=True))
    while spans:
        first, last = spans.pop()
        if last - first < 2:
            continue
        between = followed[first + 1 : last]
        way = followed[last] - followed[first]
        share = (between - followed[first]) @ way / max(float(way @ way), 1e-12)
        nearest = followed[first] + np.outer(np.clip(share, 0.0, 1.0), way)
        off = np.linalg.norm(between - nearest, axis=1)
        if off.max() > tolerance:
            middle = first + 1 + int(off.argmax())
            wanted[middle] = True
            spans += [(first, middle), (middle, last)]
    return np.flatnonzero(wanted)
