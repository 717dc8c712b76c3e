"""A planned motion as a robot can drive it: its joints, and as slow as they need it to be."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.optimize import linprog
from scipy.sparse import coo_array, vstack
from scipy.spatial.transform import Rotation, Slerp

from paint_deposition.errors import PlanError
from paint_deposition.motion.arm import Arm
from paint_deposition.motion.part_frame import Rigid
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.planning.configurations import REACHED, follow, settled, starts

# Joints are looked at this often along the planned motion [s].
STEP_S = 0.02
# The way is chosen over poses that lie so far apart.
APART_M, APART_RAD = 0.02, math.radians(3.0)
# A joint of which nothing more is known reaches its full speed in this time [s].
FULL_SPEED_S = 0.25
# Speeds and accelerations keep this share below the limits where they are looked at.
MARGIN = 0.03
# Ways that come nearer to the limit of a joint than this share of its range are avoided.
NEAR_LIMIT = 0.05
# Below this share of the planned speed the robot stands in a singularity.
SLOWEST = 0.02
# Smaller losses of speed are not told.
TOLD = 0.005


@dataclass(frozen=True)
class PassLimit:
    """The joint that keeps a pass from its planned speed."""

    number: int  # of the pass, from 1
    share: float  # of the planned speed that is left
    joint: str
    of_speed: bool  # whether its speed limits, not its acceleration

    def __str__(self) -> str:
        what = 'speed' if self.of_speed else 'acceleration'
        return (
            f'pass {self.number} runs at {100 * self.share:.0f} % of the planned speed, which the '
            f'{what} of {self.joint} allows'
        )


@dataclass(frozen=True)
class Drive:
    """A motion with the joints that drive it.

    Attributes:
        trajectory: the poses in the part's frame, timed as the joints allow, and rolled.
        seconds: (M,) times of the joints from the first pose [s].
        joints: (M, J) [rad or m].
        limits: of passes that are slower than planned.
        least_singular_value: of the tip's velocity by those of the joints, m and rad alike.
    """

    arm: Arm
    trajectory: Trajectory
    seconds: np.ndarray
    joints: np.ndarray
    limits: tuple[PassLimit, ...]
    least_singular_value: float

    @property
    def to_limit(self) -> tuple[float, str]:
        """How near a joint comes to its limit, as a share of its range, and which."""
        share = self.arm.room(self.joints).min(axis=0)
        nearest = int(np.argmin(share))
        return float(share[nearest]), self.arm.joints[nearest]

    def to_dict(self) -> dict[str, Any]:
        """The figures by name."""
        room, joint = self.to_limit
        return {
            'joints': list(self.arm.joints),
            'nearest_to_limit': {'joint': joint, 'share_of_range': room},
            'least_singular_value': self.least_singular_value,
            'limits': [vars(limit) for limit in self.limits],
        }


@dataclass(frozen=True)
class RobotCell:
    """A robot and where the part stands in its base.

    ``acceleration`` is that of every joint [rad/s2 or m/s2]; None: each reaches its full speed in
    a quarter of a second.
    """

    arm: Arm
    part: Rigid
    acceleration: float | None = None

    def drive(self, trajectory: Trajectory, free_roll: bool) -> Drive:
        """The joints that drive a motion in the frame of the part.

        The way through all poses is the one that the joints can drive the fastest. Where they
        cannot keep up the motion is slowed down, each pass as a whole. With ``free_roll`` the tool
        may be turned about its own axis, by one angle for the whole motion.

        Raises:
            PlanError: the robot does not reach all poses.
        """
        arm, begin_ns = self.arm, int(trajectory.stamps_ns[0])
        clock_s = 1e-9 * (trajectory.stamps_ns - begin_ns)
        times_s = np.linspace(0.0, clock_s[-1], max(4, math.ceil(clock_s[-1] / STEP_S) + 1))
        positions, turns = self.poses(trajectory, times_s)
        joints, roll_rad = _joints(arm, positions, turns, times_s, free_roll)
        most = arm.fastest / FULL_SPEED_S
        if self.acceleration is not None:
            most = np.full(len(arm), self.acceleration)
        pace = _Pace(arm.joints, times_s, CubicSpline(times_s, joints), arm.fastest, most)
        opening = _openings(trajectory, clock_s, times_s)
        shares = pace.shares(opening)
        steps_s = 2.0 * np.diff(times_s) / (shares[1:] + shares[:-1])
        seconds = np.append(0.0, np.cumsum(steps_s))
        seconds *= pace.overrun(seconds, joints)

        def slowed_ns(stamps_ns: np.ndarray) -> np.ndarray:
            later_s = np.interp(1e-9 * (stamps_ns - begin_ns), times_s, seconds)
            return begin_ns + np.round(1e9 * later_s).astype(np.int64)

        rolled = Rotation.from_quat(trajectory.quaternions_xyzw) * _roll(roll_rad)
        slowed = replace(
            trajectory,
            stamps_ns=slowed_ns(trajectory.stamps_ns),
            trigger_stamps_ns=slowed_ns(trajectory.trigger_stamps_ns),
            quaternions_xyzw=rolled.as_quat(),
        )
        values = np.linalg.svd(arm.jacobians(joints)[2], compute_uv=False)
        limits = pace.limits(opening, shares)
        return Drive(arm, slowed, seconds, joints, limits, float(values[:, -1].min()))

    def poses(self, trajectory: Trajectory, times_s: np.ndarray) -> tuple[np.ndarray, Rotation]:
        """Positions (N, 3) and turns of the tool in the robot's base at times (N,)."""
        clock_s = 1e-9 * (trajectory.stamps_ns - trajectory.stamps_ns[0])
        places = PchipInterpolator(clock_s, trajectory.positions_m)(times_s)
        turns = Slerp(clock_s, Rotation.from_quat(trajectory.quaternions_xyzw))(times_s)
        stands = self.part.rotation
        return (
            places @ stands.T + self.part.translation_m, Rotation.from_matrix(stands) * turns
        )  # fmt: skip


def _joints(
    arm: Arm, positions_m: np.ndarray, turns: Rotation, times_s: np.ndarray, free_roll: bool
) -> tuple[np.ndarray, float]:
    """Joints (N, J) for poses in the robot's base, and by how much the tool is rolled [rad]."""
    rows = _apart(positions_m, turns)
    way, roll_rad = _best_way(arm, positions_m[rows], turns[rows], times_s[rows], free_roll)
    axes = (turns * _roll(roll_rad)).as_matrix()
    joints, error = settled(
        arm, PchipInterpolator(times_s[rows], way)(times_s), positions_m, axes
    )
    if error.max() > REACHED:
        raise PlanError(
            f'the robot stands in a singularity near {_words(positions_m[error.argmax()])} m in '
            'its base; let the part stand elsewhere, paint place shows where'
        )
    return joints, roll_rad


def _roll(roll_rad: float) -> Rotation:
    return Rotation.from_rotvec([0.0, 0.0, roll_rad])


def _apart(positions_m: np.ndarray, turns: Rotation) -> np.ndarray:
    """Rows of poses about APART from each other, both ends included."""
    angle = (turns[:-1].inv() * turns[1:]).magnitude()
    way = np.linalg.norm(np.diff(positions_m, axis=0), axis=1) / APART_M + angle / APART_RAD
    steps = np.floor(np.append(0.0, np.cumsum(way)))
    rows = np.flatnonzero(np.diff(steps, prepend=-1.0) > 0.0)
    return np.union1d(rows, len(steps) - 1)


def _best_way(
    arm: Arm, positions_m: np.ndarray, turns: Rotation, times_s: np.ndarray, free_roll: bool
) -> tuple[np.ndarray, float]:
    """(N, J), of all ways through the poses the one that is driven the fastest, and its roll."""
    begin = starts(arm, positions_m[0], turns[0].as_matrix(), free_roll)
    if not begin:
        raise PlanError(
            f'the robot does not reach the first pose, {_words(positions_m[0])} m in its base; '
            'check --part-pose, or let paint place look where the part may stand'
        )
    axes = np.stack([(turns * _roll(one.roll_rad)).as_matrix() for one in begin])
    positions = np.broadcast_to(positions_m, (len(begin), *positions_m.shape))
    ways = follow(arm, np.array([one.joints for one in begin]), positions, axes)
    if not len(ways.whole):
        far = int(ways.reached.max())
        raise PlanError(
            f'the robot follows the motion to {times_s[far]:.1f} of {times_s[-1]:.1f} s and not '
            f'beyond {_words(positions_m[far])} m in its base, in none of {len(begin)} '
            'configurations; let paint place look where the part may stand'
        )
    joints = ways.joints[ways.whole]
    speeds = np.abs(np.diff(joints, axis=1)) / np.diff(times_s)[:, np.newaxis]
    late = np.maximum((speeds / arm.fastest).max(axis=2), 1.0)
    near = np.maximum(1.0 - arm.room(joints).min(axis=(1, 2)) / NEAR_LIMIT, 0.0)
    best = np.argmin(late.mean(axis=1) + near + speeds.mean(axis=(1, 2)) / arm.fastest.mean())
    return joints[best], begin[ways.whole[best]].roll_rad


def _openings(trajectory: Trajectory, clock_s: np.ndarray, times_s: np.ndarray) -> np.ndarray:
    """(N,) number of the opening of the gun in which each time lies, -1 for none."""
    found = np.full(len(times_s), -1)
    stamps_s = 1e-9 * (trajectory.trigger_stamps_ns - trajectory.stamps_ns[0])
    ends_s, number = np.append(stamps_s, clock_s[-1]), 0
    for k, flow in enumerate(trajectory.trigger_flow):
        if flow > 0.0:
            found[(times_s >= ends_s[k] - STEP_S) & (times_s <= ends_s[k + 1] + STEP_S)] = number
            number += 1
    return found


@dataclass(frozen=True)
class _Pace:
    """What the joints along a motion allow; they are a function of the planned time."""

    names: tuple[str, ...]

    times_s: np.ndarray
    joints: CubicSpline
    fastest: np.ndarray
    most: np.ndarray

    def shares(self, opening: np.ndarray) -> np.ndarray:
        """(N,) share of the planned speed at the times, the greatest that the joints allow.

        With b the square of the share the joints' accelerations are linear in b and its slope
        (Verscheure et al. 2009), so that the fastest motion is a linear program. A pass keeps one
        share, or its film would be uneven.
        """
        count, step = len(self.times_s), self.times_s[1]
        column = np.where(opening >= 0, opening, opening.max() + 1 + np.cumsum(opening < 0))
        speed = np.abs(self.joints(self.times_s, 1)) / (1.0 - MARGIN)
        highest = np.minimum(1.0, (self.fastest / np.maximum(speed, 1e-12)).min(axis=1) ** 2)
        bound = np.ones(column.max() + 1)
        np.minimum.at(bound, column, highest)
        middle = self.times_s[:-1] + 0.5 * step
        rows, sides = [], []
        for slope, bend, most in zip(
            self.joints(middle, 1).T, self.joints(middle, 2).T, (1.0 - MARGIN) * self.most,
            strict=True,
        ):  # fmt: skip
            before, after = 0.5 * bend - 0.5 * slope / step, 0.5 * bend + 0.5 * slope / step
            row = np.arange(count - 1)
            part = coo_array(
                (np.append(before, after), (np.tile(row, 2), np.append(column[:-1], column[1:]))),
                shape=(count - 1, len(bound)),
            )
            rows += [part, -part]
            sides += [np.full(count - 1, most)] * 2
        weights = np.bincount(column, minlength=len(bound)).astype(float)
        solved = linprog(
            -weights, A_ub=vstack(rows).tocsr(), b_ub=np.concatenate(sides),
            bounds=np.stack([np.zeros_like(bound), bound], axis=1), method='highs',
        )  # fmt: skip
        shares = np.sqrt(np.maximum(solved.x, 0.0))[column]
        if shares.min() < SLOWEST:
            raise PlanError(
                f'the robot has to stand almost still {self.times_s[shares.argmin()]:.1f} s after '
                'the first pose; let the part stand elsewhere, paint place shows where'
            )
        return shares

    def overrun(self, seconds: np.ndarray, joints: np.ndarray) -> float:
        """By how much all must be slower for the limits to hold between the times, too."""
        path = CubicSpline(seconds, joints)
        dense = np.linspace(0.0, seconds[-1], 8 * len(seconds))
        speed = (np.abs(path(dense, 1)) / self.fastest).max()
        rate = (np.abs(path(dense, 2)) / self.most).max()
        return float(max(1.0, speed, math.sqrt(rate)))

    def limits(self, opening: np.ndarray, shares: np.ndarray) -> tuple[PassLimit, ...]:
        """Of the passes that are slower than planned, the joint that makes them so."""
        slope = np.abs(self.joints(self.times_s, 1)) / self.fastest
        bend = np.sqrt(np.abs(self.joints(self.times_s, 2)) / self.most)
        found = []
        for number in range(opening.max() + 1):
            inside = opening == number
            share = float(shares[inside].min())
            if share > 1.0 - TOLD:
                continue
            speed, rate = slope[inside].max(axis=0), bend[inside].max(axis=0)
            of_speed = speed.max() > rate.max()
            joint = int(np.argmax(speed if of_speed else rate))
            found.append(PassLimit(number + 1, share, self.names[joint], bool(of_speed)))
        return tuple(found)


def _words(place_m: np.ndarray) -> str:
    return '(' + ', '.join(f'{value:.2f}' for value in place_m) + ')'
