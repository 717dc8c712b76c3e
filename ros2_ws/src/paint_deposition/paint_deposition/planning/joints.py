"""Joints of a robot whose tip follows given poses, and how fast they can.

All starts are followed side by side by damped Newton steps (Nakamura and Hanafusa 1986), so that
the best way through all poses can be chosen. The fastest motion along it is a linear program.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import maximum_filter1d
from scipy.optimize import linprog
from scipy.sparse import coo_array, vstack
from scipy.spatial.transform import Rotation

from paint_deposition.errors import PaintError
from paint_deposition.motion.arm import Arm

# Steps towards a pose from a pose beside it.
ROUNDS = 12
# A pose is reached within this [m and rad].
REACHED = 1e-5
# Speeds and accelerations keep this share below the limits where they are looked at.
MARGIN = 0.03

# A configuration (J,) at the first pose, the tool rolled about its axis by so much [rad].
Start = tuple[np.ndarray, float]


def starts(arm: Arm, position_m: np.ndarray, axes: np.ndarray, free_roll: bool) -> list[Start]:
    """Configurations that reach a pose, the farthest from the limits first.

    With ``free_roll`` the tool is turned about its own axis by any angle.
    """
    rng, count = np.random.default_rng(0), 600
    # A joint without limits begins within pi of zero [rad or m].
    lower = np.where(np.isfinite(arm.lower), arm.lower, -np.pi)
    upper = np.where(np.isfinite(arm.upper), arm.upper, np.pi)
    roll_rad = rng.uniform(-np.pi, np.pi, count) if free_roll else np.zeros(count)
    wanted = axes @ Rotation.from_rotvec(np.outer(roll_rad, (0, 0, 1))).as_matrix()
    joints = rng.uniform(lower, upper, (count, len(arm)))
    joints, error = towards(arm, joints, position_m, wanted, rounds=60)
    middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    turns = np.round((joints - middle) / (2.0 * np.pi))
    joints = np.where(arm.slides, joints, joints - 2.0 * np.pi * turns)
    good = np.flatnonzero((error < REACHED) & within(arm, joints))
    found: list[Start] = []
    for row in good[np.argsort(np.abs((joints - middle) / half).max(axis=1)[good])]:
        # Configurations that differ by less are one [rad or m].
        if all(np.abs(joints[row] - other).max() > 0.1 for other, _ in found):
            found.append((joints[row], float(roll_rad[row])))
    return found[:40]


def towards(
    arm: Arm, joints: np.ndarray, positions_m: np.ndarray, axes: np.ndarray, rounds: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """Steps of joints (..., J) towards poses, positions (..., 3) and axes (..., 3, 3).

    Returns the new joints and the error (...) before the last step [m and rad].
    """
    for _ in range(rounds):
        position, tip, jacobian = arm.jacobians(joints)
        turn = 0.5 * np.cross(tip, axes, axis=-2).sum(axis=-1)
        error = np.concatenate([positions_m - position, turn], axis=-1)
        # No step turns a joint further [rad or m]; near a singularity steps are damped.
        square = jacobian @ jacobian.swapaxes(-1, -2) + 1e-3**2 * np.eye(6)
        step = jacobian.swapaxes(-1, -2) @ np.linalg.solve(square, error[..., np.newaxis])
        step = step[..., 0]
        longest = np.abs(step).max(axis=-1, keepdims=True)
        step *= np.minimum(1.0, 0.5 / np.maximum(longest, 1e-12))
        joints = joints + step
    return joints, np.linalg.norm(error, axis=-1)


def within(arm: Arm, joints: np.ndarray) -> np.ndarray:
    """(...) whether joints (..., J) keep their limits."""
    outside = (joints < arm.lower) | (joints > arm.upper)
    return np.logical_not(outside.any(axis=-1))


def rolled(roll_rad: float) -> Rotation:
    """The turn of a tool that is rolled about its own axis."""
    return Rotation.from_rotvec([0.0, 0.0, roll_rad])


def ways_of(
    arm: Arm,
    positions_m: np.ndarray,
    turns: Rotation,
    free_roll: bool,
    chosen: Start | None = None,
) -> tuple[list[Start], np.ndarray, np.ndarray]:
    """Follow poses (N, 3) [m] with their turns (N,) from all starts, or from the chosen one.

    Returned are the S starts; joints (S, N, J), NaN behind the last pose that is reached; and (S,)
    how many poses are reached from each within the limits.
    """
    begins = [chosen] if chosen else starts(arm, positions_m[0], turns[0].as_matrix(), free_roll)
    axes = np.reshape([(turns * rolled(roll_rad)).as_matrix() for _, roll_rad in begins],
                      (len(begins), len(positions_m), 3, 3))  # fmt: skip
    ways = np.full((len(begins), len(positions_m), len(arm)), np.nan)
    reached = np.full(len(begins), len(positions_m))
    now = np.reshape([joints for joints, _ in begins], (len(begins), len(arm)))
    left = np.arange(len(begins))
    for n, position_m in enumerate(positions_m):
        for _ in range(ROUNDS):
            now, error = towards(arm, now, position_m, axes[left, n])
            if (error < REACHED).all():
                break
        good = (error < REACHED) & within(arm, now)
        reached[left[~good]] = n
        now, left = now[good], left[good]
        ways[left, n] = now
        if not len(left):
            break
    return begins, ways, reached


def rows_apart(
    positions_m: np.ndarray, turns: Rotation, step_m: float, step_rad: float
) -> np.ndarray:
    """Rows of poses (N,) that lie about so much travel or turn apart, both ends included."""
    way = np.linalg.norm(np.diff(positions_m, axis=0), axis=1) / step_m
    way += (turns[:-1].inv() * turns[1:]).magnitude() / step_rad
    steps = np.floor(np.append(0.0, np.cumsum(way)))
    return np.union1d(np.flatnonzero(np.diff(steps, prepend=-1.0) > 0.0), len(steps) - 1)


def fastest_way(arm: Arm, ways: np.ndarray, reached: np.ndarray, times_s: np.ndarray) -> int:
    """Row of the way, of those that reach all, that is driven the fastest, clear of limits."""
    whole = np.flatnonzero(reached == len(times_s))
    joints = ways[whole]
    speeds = np.abs(np.diff(joints, axis=1)) / np.diff(times_s)[:, np.newaxis] / arm.fastest
    late = np.maximum(speeds.max(axis=2), 1.0)
    # Ways that come nearer to the limit of a joint than this share of its range are avoided.
    near = np.maximum(1.0 - arm.room(joints).min(axis=(1, 2)) / 0.05, 0.0)
    return int(whole[np.argmin(late.mean(axis=1) + near + speeds.mean(axis=(1, 2)))])


@dataclass(frozen=True)
class JointPace:
    """What the joints along a motion allow; they are a function of the planned time."""

    arm: Arm
    times_s: np.ndarray  # (N,) planned times
    joints: CubicSpline
    most: np.ndarray  # (J,) greatest accelerations

    def shares(self, spray_pass: np.ndarray) -> np.ndarray:
        """(N,) share of the planned speed at the times, the greatest that the joints allow.

        Of each time (N,) the number of its pass is given, -1 between passes. A pass keeps one
        share, or its film would be uneven.

        Raises:
            PaintError: the joints hardly allow any speed.
        """
        room = np.ones(len(self.times_s) - 1)
        # Limits that are not kept between the times are tightened there, so often at the most.
        for _ in range(8):
            shares = self._shares(spray_pass, room)
            over = self.driven(shares)[-1]
            if over.max() <= 1.0:
                return shares
            room /= np.maximum(over, 1.0)
        return shares / math.sqrt(over.max())

    def _shares(self, spray_pass: np.ndarray, room: np.ndarray) -> np.ndarray:
        """The shares where each step (N - 1,) keeps to this part of the limits.

        With b the square of the share the joints' accelerations are linear in b and its slope
        (Verscheure et al. 2009), so that the fastest motion is a linear program.
        """
        # No motion is slowed down to less: the robot stands in a singularity there.
        slowest = 0.01
        count, step = len(self.times_s), self.times_s[1]
        outside = spray_pass < 0
        column = np.where(outside, spray_pass.max() + 1 + np.cumsum(outside), spray_pass)
        # The neighbours count too: the share changes evenly between the times.
        speed = maximum_filter1d(np.abs(self.joints(self.times_s, 1)), 3, axis=0) / (1.0 - MARGIN)
        highest = np.minimum(1.0, (self.arm.fastest / np.maximum(speed, 1e-12)).min(axis=1) ** 2)
        highest *= np.minimum(np.append(room, 1.0), np.append(1.0, room))
        bound = np.ones(column.max() + 1)
        np.minimum.at(bound, column, highest)
        slopes, bends = self.joints(self.times_s, 1).T, self.joints(self.times_s, 2).T
        row, sides, rows = np.arange(count - 1), [], []
        # At both ends of every step: between them the acceleration is nearly linear.
        for end in (row, row + 1):
            for slope, bend, most in zip(slopes, bends, (1.0 - MARGIN) * self.most, strict=True):
                change = 0.5 * slope[end] / step
                part = coo_array(
                    (
                        np.concatenate([-change, change, bend[end]]),
                        (np.tile(row, 3), column[np.concatenate([row, row + 1, end])]),
                    ),
                    shape=(count - 1, len(bound)),
                )
                rows += [part, -part]
                sides += [most * room] * 2
        weights = np.bincount(column, minlength=len(bound)).astype(float)
        solved = linprog(
            -weights, A_ub=vstack(rows).tocsr(), b_ub=np.concatenate(sides),
            bounds=np.stack([np.full_like(bound, slowest**2), bound], axis=1), method='highs',
        )  # fmt: skip
        if solved.x is None:
            raise PaintError(
                f'some joints have less than {100 * slowest:.0f} % of the speed or acceleration '
                'that the motion needs; let the part stand elsewhere, paint place shows where'
            )
        return np.sqrt(solved.x)[column]

    def driven(
        self, shares: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """The joints at these shares (N,) of the planned speed.

        Returned are the times (N,) at which the planned ones are reached; times (M,) at an even
        rate with the joints and their speeds (M, J) there; and for each step (N - 1,) the greatest
        acceleration, or square of a speed, over its limit. Between planned times the share changes
        evenly.
        """
        steps_s = 2.0 * np.diff(self.times_s) / (shares[1:] + shares[:-1])
        reached_s = np.append(0.0, np.cumsum(steps_s))
        # Of the joints that are written.
        seconds = np.linspace(0.0, reached_s[-1], math.ceil(reached_s[-1] * 250.0) + 1)
        step = np.clip(np.searchsorted(reached_s, seconds, side='right') - 1, 0, len(shares) - 2)
        since = seconds - reached_s[step]
        rise = (np.diff(shares) / steps_s)[step]
        planned_s = self.times_s[step] + shares[step] * since + 0.5 * rise * since**2
        share = (shares[step] + rise * since)[:, np.newaxis]
        joints, slope = self.joints(planned_s), self.joints(planned_s, 1)
        rate = self.joints(planned_s, 2) * share**2 + slope * rise[:, np.newaxis]
        of_limit = np.maximum((slope * share / self.arm.fastest) ** 2, np.abs(rate) / self.most)
        over = np.zeros(len(steps_s))
        np.maximum.at(over, step, of_limit.max(axis=1))
        return reached_s, seconds, joints, slope * share, over

    def limits(self, spray_pass: np.ndarray, shares: np.ndarray) -> dict[str, dict[str, Any]]:
        """Which joint makes a pass slower than planned, for each such pass: sentence, figures.

        They are the number of the pass, from 1; the share of the planned speed that is left; the
        joint; and whether its speed limits, not its acceleration (``of_speed``).
        """
        slope = np.abs(self.joints(self.times_s, 1)) / self.arm.fastest
        bend = np.sqrt(np.abs(self.joints(self.times_s, 2)) / self.most)
        found = {}
        for number in np.unique(spray_pass[spray_pass >= 0]).tolist():
            inside = spray_pass == number
            share = float(shares[inside].min())
            # Smaller losses of speed are not told.
            if share > 0.995:
                continue
            speed, rate = slope[inside].max(axis=0), bend[inside].max(axis=0)
            of_speed = speed.max() > rate.max()
            joint = int(np.argmax(speed if of_speed else rate))
            name, what = self.arm.joints[joint], 'speed' if of_speed else 'acceleration'
            sentence = (
                f'pass {number + 1} runs at {100 * share:.0f} % of the planned speed, which the '
                f'{what} of {name} allows'
            )
            told = {'number': number + 1, 'share': share, 'joint': name}
            found[sentence] = told | {'of_speed': bool(of_speed)}
        return found
