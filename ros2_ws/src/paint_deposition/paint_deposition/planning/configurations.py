"""Joints of a robot whose tip follows given poses, near each other from pose to pose.

All starts are followed side by side by damped Newton steps (Nakamura and Hanafusa 1986), so that
the best way through all poses can be chosen.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from paint_deposition.motion.arm import Arm

# Random starts, and how many of those that reach the first pose are followed.
STARTS, FOLLOWED = 600, 40
START_ROUNDS, ROUNDS = 60, 12
# A pose is reached within this [m and rad].
REACHED = 1e-5
# No step turns a joint further [rad or m]; near a singularity steps are damped.
LONGEST_STEP, DAMPING = 0.5, 1e-3
# A joint without limits begins within this of zero [rad or m].
UNLIMITED = np.pi
# Configurations that differ by less are one [rad or m].
SAME = 0.1


@dataclass(frozen=True)
class Start:
    """A configuration (J,) at the first pose, the tool rolled about its axis by so much [rad]."""

    joints: np.ndarray
    roll_rad: float


@dataclass(frozen=True)
class Ways:
    """S ways to follow N poses.

    Attributes:
        joints: (S, N, J), NaN behind the last pose that is reached.
        reached: (S,) number of poses that each reaches within the limits.
    """

    joints: np.ndarray
    reached: np.ndarray

    @property
    def whole(self) -> np.ndarray:
        """Rows of the ways that reach all poses."""
        return np.flatnonzero(self.reached == self.joints.shape[1])


def starts(
    arm: Arm, position_m: np.ndarray, axes: np.ndarray, free_roll: bool, seed: int = 0
) -> list[Start]:
    """Configurations that reach a pose, the farthest from the limits first.

    With ``free_roll`` the tool is turned about its own axis by any angle.
    """
    rng = np.random.default_rng(seed)
    lower = np.where(np.isfinite(arm.lower), arm.lower, -UNLIMITED)
    upper = np.where(np.isfinite(arm.upper), arm.upper, UNLIMITED)
    roll_rad = rng.uniform(-np.pi, np.pi, STARTS) if free_roll else np.zeros(STARTS)
    joints, error = rng.uniform(lower, upper, (STARTS, len(arm))), np.full(STARTS, np.inf)
    wanted = axes @ Rotation.from_rotvec(np.outer(roll_rad, (0, 0, 1))).as_matrix()
    for _ in range(START_ROUNDS):
        joints, error = towards(arm, joints, position_m, wanted)
    middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    turns = np.round((joints - middle) / (2.0 * np.pi))
    joints = np.where(arm.slides, joints, joints - 2.0 * np.pi * turns)
    good = np.flatnonzero((error < REACHED) & within(arm, joints))
    found: list[Start] = []
    for row in good[np.argsort(np.abs((joints - middle) / half).max(axis=1)[good])]:
        if all(np.abs(joints[row] - other.joints).max() > SAME for other in found):
            found.append(Start(joints[row], float(roll_rad[row])))
    return found[:FOLLOWED]


def follow(arm: Arm, begin: np.ndarray, positions_m: np.ndarray, axes: np.ndarray) -> Ways:
    """Follow poses (S, N, 3) [m] and (S, N, 3, 3) from configurations (S, J) at the first ones."""
    joints = np.full((*positions_m.shape[:2], len(arm)), np.nan)
    reached = np.full(len(begin), joints.shape[1])
    now, left = begin, np.arange(len(begin))
    for n in range(joints.shape[1]):
        for _ in range(ROUNDS):
            now, error = towards(arm, now, positions_m[left, n], axes[left, n])
            if (error < REACHED).all():
                break
        good = (error < REACHED) & within(arm, now)
        reached[left[~good]] = n
        now, left = now[good], left[good]
        joints[left, n] = now
        if not len(left):
            break
    return Ways(joints, reached)


def settled(
    arm: Arm, joints: np.ndarray, positions_m: np.ndarray, axes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Joints (N, J) near given ones that hold poses (N, 3) and (N, 3, 3), and the error (N,)."""
    error = np.full(len(joints), np.inf)
    for _ in range(ROUNDS):
        joints, error = towards(arm, joints, positions_m, axes)
    return joints, error


def towards(
    arm: Arm, joints: np.ndarray, positions_m: np.ndarray, axes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """A step of joints (..., J) towards poses, positions (..., 3) and axes (..., 3, 3).

    Returns the new joints and the error (...) before the step [m and rad].
    """
    position, tip, jacobian = arm.jacobians(joints)
    turn = 0.5 * np.cross(tip, axes, axis=-2).sum(axis=-1)
    error = np.concatenate([positions_m - position, turn], axis=-1)
    square = jacobian @ jacobian.swapaxes(-1, -2) + DAMPING**2 * np.eye(6)
    step = jacobian.swapaxes(-1, -2) @ np.linalg.solve(square, error[..., np.newaxis])
    step = step[..., 0]
    longest = np.abs(step).max(axis=-1, keepdims=True)
    step *= np.minimum(1.0, LONGEST_STEP / np.maximum(longest, 1e-12))
    return joints + step, np.linalg.norm(error, axis=-1)


def within(arm: Arm, joints: np.ndarray) -> np.ndarray:
    """(...) whether joints (..., J) keep their limits."""
    outside = (joints < arm.lower) | (joints > arm.upper)
    return np.logical_not(outside.any(axis=-1))
