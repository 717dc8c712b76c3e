"""A planned motion as a robot can drive it, and where the part may stand for all of it."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.spatial.transform import Rotation, Slerp

from paint_deposition.errors import PaintError
from paint_deposition.motion.arm import Arm
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.motion.trajectory import DEFAULT_MAX_POSE_GAP_S, Trajectory, gap_ns
from paint_deposition.motion.transforms import Rigid, moved
from paint_deposition.planning.joints import (
    MARGIN,
    REACHED,
    ROUNDS,
    JointPace,
    Start,
    fastest_way,
    rolled,
    rows_apart,
    towards,
    ways_of,
)

# Joints are looked at this often along the planned motion [s].
STEP_S = 0.02


@dataclass(frozen=True)
class Drive:
    """A motion with the joints that drive it."""

    arm: Arm
    trajectory: Trajectory  # poses in the part's frame, timed as the joints allow, and rolled
    seconds: np.ndarray  # (M,) times of the joints from the first pose [s]
    joints: np.ndarray  # (M, J) [rad or m], and their speeds (M, J) per second
    speeds: np.ndarray
    # Why passes are slower than planned: sentences, with figures as of ``JointPace.limits``.
    limits: dict[str, dict[str, Any]]
    least_singular_value: float  # of the tip's velocity by those of the joints, m and rad alike

    @property
    def to_limit(self) -> tuple[float, str]:
        """How near a joint comes to its limit, as a share of its range, and which."""
        share = self.arm.room(self.joints).min(axis=0)
        nearest = int(np.argmin(share))
        return float(share[nearest]), self.arm.joints[nearest]

    @property
    def sentence(self) -> str:
        """How the robot drives it, in a sentence."""
        room, joint = self.to_limit
        slow = (
            f'with {len(self.limits)} of its passes slowed down' if self.limits else 'as planned'
        )
        return (
            f'driven {slow}; {joint} comes within {100 * room:.0f} % of its range of a limit; '
            f'nearest singularity {self.least_singular_value:.2g} m/s per rad/s'
        )

    def to_dict(self) -> dict[str, Any]:
        """The figures by name."""
        room, joint = self.to_limit
        return {
            'joints': list(self.arm.joints),
            'nearest_to_limit': {'joint': joint, 'share_of_range': room},
            'least_singular_value': self.least_singular_value,
            'limits': list(self.limits.values()),
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

    def drive(self, trajectory: Trajectory, free_roll: bool, begin: Start | None = None) -> Drive:
        """The joints that drive a motion in the frame of the part.

        The way through all poses is the one that the joints can drive the fastest. Where they
        cannot keep up the motion is slowed down, each pass as a whole. With ``free_roll`` the tool
        may be turned about its own axis, by one angle for the whole motion. ``begin`` is the
        configuration to begin in, where it is chosen already.

        Raises:
            PaintError: the robot does not reach all poses.
        """
        arm, first_ns = self.arm, int(trajectory.stamps_ns[0])
        times_s, _, joints, begun = self._joints(trajectory, free_roll, begin)
        # A joint of which nothing more is known reaches its full speed in this time [s].
        most = arm.fastest / 0.25
        if self.acceleration is not None:
            most = np.full(len(arm), self.acceleration)
        pace = JointPace(arm, times_s, CubicSpline(times_s, joints), most)
        # The pass that is sprayed at each time, as a simulation counts; -1 for none.
        spray_pass = np.full(len(times_s), -1)
        path, _ = spray_path(trajectory)
        sprayed = path.select(path.flow > 0.0)
        if len(sprayed):
            at_s = 1e-9 * (sprayed.stamp_ns - first_ns)
            nearest = np.searchsorted(0.5 * (at_s[1:] + at_s[:-1]), times_s)
            near = np.abs(at_s[nearest] - times_s) <= 0.5 * sprayed.dwell_s[nearest] + STEP_S
            spray_pass[near] = sprayed.spray_pass[nearest][near]
        shares = pace.shares(spray_pass)
        reached_s, seconds, driven, speeds, _ = pace.driven(shares)

        def slowed_ns(stamps_ns: np.ndarray) -> np.ndarray:
            later_s = np.interp(1e-9 * (stamps_ns - first_ns), times_s, reached_s)
            return first_ns + np.round(1e9 * later_s).astype(np.int64)

        trajectory = _without_gaps(trajectory, slowed_ns(trajectory.stamps_ns))
        turns = Rotation.from_quat(trajectory.quaternions_xyzw) * rolled(begun[1])
        slowed = replace(
            trajectory,
            stamps_ns=slowed_ns(trajectory.stamps_ns),
            trigger_stamps_ns=slowed_ns(trajectory.trigger_stamps_ns),
            quaternions_xyzw=turns.as_quat(),
        )
        values = np.linalg.svd(arm.jacobians(joints)[2], compute_uv=False)
        limits = pace.limits(spray_pass, shares)
        return Drive(arm, slowed, seconds, driven, speeds, limits, float(values[:, -1].min()))

    def allowed_speeds(
        self, trajectory: Trajectory
    ) -> tuple[tuple[np.ndarray, np.ndarray], Start]:
        """Travels (N,) along a motion, in the frame of the part, and the speeds (N,) [m/s] there
        at which a joint runs at its greatest speed; and the configuration in which it begins.
        """
        _, positions, joints, begun = self._joints(trajectory, False)
        steps_m = np.linalg.norm(np.diff(positions, axis=0), axis=1)
        share = np.abs(np.diff(joints, axis=0)) / (1.0 - MARGIN) / self.arm.fastest
        speed = steps_m / np.maximum(share.max(axis=1), 1e-9)
        travel = np.append(0.0, np.cumsum(steps_m))
        moving = steps_m > 1e-6
        return (0.5 * (travel[1:] + travel[:-1])[moving], speed[moving]), begun

    def _joints(
        self, trajectory: Trajectory, free_roll: bool, begin: Start | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, Start]:
        """Follow a motion by the way that is driven the fastest.

        Returned are times (N,) [s], positions (N, 3) [m] in the robot's base, joints (N, J), and
        the configuration in which they begin.
        """
        count = max(4, math.ceil(trajectory.duration_s / STEP_S) + 1)
        times_s = np.linspace(0.0, trajectory.duration_s, count)
        positions_m, turns = self.poses(trajectory, times_s)
        rows = rows_apart(positions_m, turns, 0.02, math.radians(3.0))
        some_s, some_m = times_s[rows], positions_m[rows]
        begins, ways, reached = ways_of(self.arm, some_m, turns[rows], free_roll, begin)
        if not begins:
            raise PaintError(
                f'the robot does not reach the first pose, {_words(some_m[0])} m in its base; '
                'check --part-pose, or let paint place look where the part may stand'
            )
        far = int(reached.max())
        if far < len(rows):
            raise PaintError(
                f'the robot follows the motion to {some_s[far]:.1f} of {some_s[-1]:.1f} s and not '
                f'beyond {_words(some_m[far])} m in its base, in none of {len(begins)} '
                'configurations; let paint place look where the part may stand'
            )
        best = fastest_way(self.arm, ways, reached, some_s)
        axes = (turns * rolled(begins[best][1])).as_matrix()
        near = PchipInterpolator(some_s, ways[best])(times_s)
        joints, error = towards(self.arm, near, positions_m, axes, ROUNDS)
        if error.max() > REACHED:
            raise PaintError(
                f'the robot stands in a singularity near {_words(positions_m[error.argmax()])} m '
                'in its base; let the part stand elsewhere, paint place shows where'
            )
        return times_s, positions_m, joints, begins[best]

    def poses(self, trajectory: Trajectory, times_s: np.ndarray) -> tuple[np.ndarray, Rotation]:
        """Positions (N, 3) and turns of the tool in the robot's base at times (N,)."""
        in_base = moved(trajectory, self.part, '')
        clock_s = 1e-9 * (in_base.stamps_ns - in_base.stamps_ns[0])
        turns = Slerp(clock_s, Rotation.from_quat(in_base.quaternions_xyzw))
        return PchipInterpolator(clock_s, in_base.positions_m)(times_s), turns(times_s)


def _without_gaps(trajectory: Trajectory, reached_ns: np.ndarray) -> Trajectory:
    """The motion with more poses where those at their new times (N,) [ns] would be gaps."""
    # Half of what is a gap, in which the gun is off.
    count = np.ceil(np.diff(reached_ns) / (0.5 * gap_ns(DEFAULT_MAX_POSE_GAP_S))).astype(int)
    count = np.maximum(count, 1)
    if count.max(initial=1) == 1:
        return trajectory
    number = np.append(0, np.cumsum(count))
    row = np.interp(np.arange(number[-1] + 1), number, np.arange(len(number)))
    rows, turns = np.arange(len(number)), Rotation.from_quat(trajectory.quaternions_xyzw)
    first_ns = trajectory.stamps_ns[0]
    since_ns = np.rint(np.interp(row, rows, trajectory.stamps_ns - first_ns)).astype(np.int64)
    places = [np.interp(row, rows, column) for column in trajectory.positions_m.T]
    return replace(
        trajectory,
        stamps_ns=first_ns + since_ns,
        positions_m=np.stack(places, axis=1),
        quaternions_xyzw=Slerp(rows, turns)(row).as_quat(),
    )


def _words(place_m: np.ndarray) -> str:
    return '(' + ', '.join(f'{value:.2f}' for value in place_m) + ')'
