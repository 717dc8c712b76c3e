"""How fast a robot can drive a motion: its joints' speeds and accelerations along it."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import linprog
from scipy.sparse import coo_array, vstack

from paint_deposition.errors import PlanError

# Speeds and accelerations keep this share below the limits where they are looked at.
MARGIN = 0.03
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
class JointPace:
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
        between = np.linspace(0.0, seconds[-1], 8 * len(seconds))
        speed = (np.abs(path(between, 1)) / self.fastest).max()
        # The acceleration of a cubic spline is greatest at its knots.
        rate = (np.abs(path(seconds, 2)) / self.most).max()
        return float(max(1.0, (1.0 + 1e-9) * speed, (1.0 + 1e-9) * math.sqrt(rate)))

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
