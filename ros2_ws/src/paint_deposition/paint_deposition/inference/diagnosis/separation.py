"""How many standard deviations apart the predictions of two explanations are.

Each explanation is taken as the readings at hand suggest it. The other is then refitted to imitate
it with all that is free: the pattern, the levels of parts and gauge sessions, its own amplitudes
within what is physical, and the smooth errors of both laws. What it cannot imitate, in standard
deviations of the readings, is the separation (T-optimality: Atkinson and Fedorov, Biometrika 62,
1975). Two explanations are apart by the smaller of the two.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cho_solve, cholesky, solve_triangular
from scipy.optimize import lsq_linear

from paint_deposition.inference.diagnosis.explanations import LAW_ERROR

# Precision of amplitudes that are free, which only keeps the equations regular.
ALMOST_FREE = 1e-6
# A smaller change of all readings together, in standard deviations, is none to speak of.
NOTICED = 1.0
# The error of a law is at most this large beside the law.
LARGEST_ERROR = 0.6
# The errors of laws are made smaller step by step until they are as small as they must be.
MOST_STEPS, TOLERANCE = 12, 0.1


@dataclass(frozen=True)
class Predicted:
    """What an explanation predicts for P readings, over their noise."""

    law: np.ndarray  # (P, m) change of the readings by each amplitude
    # (P, n) random functions of the covariates along which the law may be off, together of unit
    # variance.
    along: np.ndarray
    amounts: np.ndarray  # (m,) amplitudes as the readings at hand suggest them
    # (m,) bounds of the amplitudes.
    low: np.ndarray
    high: np.ndarray
    # Of the amplitudes before the readings: those of a law are free within their bounds, those of
    # a shapeless cause are not.
    precision: float = ALMOST_FREE

    @cached_property
    def change(self) -> np.ndarray:
        """(P,) change of the readings with the suggested amplitudes."""
        return self.law @ self.amounts

    @cached_property
    def error(self) -> np.ndarray:
        """(P, n) directions of the error of the law with the suggested amplitudes."""
        return LAW_ERROR * self.change[:, np.newaxis] * self.along

    def fitted(self, free: np.ndarray, readings: np.ndarray) -> 'Predicted':
        """With the amplitudes that fit readings (P,) best beside free directions (P, k)."""
        k, design = free.shape[1], np.hstack([free, self.law])
        precision = design.T @ design
        precision[np.diag_indices(len(precision))] += np.where(
            np.arange(len(precision)) < k, 1.0, self.precision
        )
        lower = cholesky(precision, lower=True, check_finite=False)
        target = solve_triangular(lower, design.T @ readings, lower=True, check_finite=False)
        amounts = solve_triangular(lower.T, target, check_finite=False)[k:]
        if (amounts < self.low).any() or (amounts > self.high).any():
            # What is free comes first in the factor, so the last rows hold the amounts alone.
            bounds = (self.low, self.high)
            amounts = lsq_linear(lower.T[k:, k:], target[k:], bounds, method='bvls').x
        return replace(self, amounts=amounts)

    def at_least_typical(self) -> 'Predicted':
        """With typical amplitudes where the readings suggest none to speak of."""
        if np.linalg.norm(self.change) >= NOTICED:
            return self
        return replace(self, amounts=np.where(self.low >= 0.0, 1.0, np.where(
            self.high <= 0.0, -1.0, 1.0)))  # fmt: skip

    def select(self, rows: np.ndarray) -> 'Predicted':
        """The same for some of the readings."""
        return replace(self, law=self.law[rows], along=self.along[rows])

    def with_more(self, more: 'Predicted') -> 'Predicted':
        """The same for further readings, too."""
        law, along = np.vstack([self.law, more.law]), np.vstack([self.along, more.along])
        return replace(self, law=law, along=along)


@dataclass(frozen=True)
class Imitation:
    """One explanation imitated by another."""

    amounts: np.ndarray  # (m,) amplitudes of the imitator
    inside: np.ndarray  # (m,) which are at no bound
    # By how much the errors of the two laws were made smaller to stay errors.
    stiffness: np.ndarray
    mean: np.ndarray  # (k,) of all that is free
    lower: np.ndarray  # (k, k) Cholesky factor of its precision
    separation: float  # standard deviations that are left

    def gains(self, free: np.ndarray, shown: Predicted, imitator: Predicted) -> np.ndarray:
        """(C,) by how much each further reading would raise the squared separation.

        Args:
            free: (C, k) directions of unit variance for these readings.
            shown, imitator: the explanations of these readings.
        """
        imitator = replace(imitator, amounts=self.amounts)
        blocks, change = _linear(free, shown, imitator, self.inside, self.stiffness)
        directions = np.hstack(blocks)
        spread = solve_triangular(self.lower, directions.T, lower=True)
        variance = 1.0 + np.sum(spread**2, axis=0)
        return (change - directions @ self.mean) ** 2 / variance


def imitate(free: np.ndarray, shown: Predicted, imitator: Predicted) -> Imitation:
    """Refit one explanation to what another predicts.

    Args:
        free: (P, k) directions of unit variance in which readings may deviate under both.
        shown, imitator: the explanations of these P readings.
    """
    stiffness = np.ones(2)
    for _ in range(MOST_STEPS):
        beside = np.hstack([free, shown.error / stiffness[0]])
        imitator = imitator.fitted(beside, shown.change)
        inside = (imitator.amounts > imitator.low) & (imitator.amounts < imitator.high)
        blocks, change = _linear(free, shown, imitator, inside, stiffness)
        directions = np.hstack(blocks)
        ends = np.cumsum([block.shape[1] for block in blocks])
        precision = directions.T @ directions
        loose = np.arange(len(precision)) >= ends[2]
        precision[np.diag_indices(len(precision))] += np.where(loose, imitator.precision, 1.0)
        lower = cholesky(precision, lower=True, check_finite=False)
        mean = cho_solve((lower, True), directions.T @ change, check_finite=False)
        parts = np.split(mean, ends[:-1])
        laws = np.array([np.linalg.norm(shown.change), np.linalg.norm(imitator.change)])
        errors = np.array([np.linalg.norm(blocks[k] @ parts[k]) for k in (1, 2)])
        excess = errors / np.maximum(LARGEST_ERROR * laws, NOTICED)
        if (excess <= 1.0 + TOLERANCE).all():
            break
        stiffness = stiffness * np.maximum(excess, 1.0)
    left = change - directions @ mean
    of_imitator = np.sqrt(imitator.precision) * parts[3]
    drawn = [parts[0], parts[1] / stiffness[0], parts[2] / stiffness[1], of_imitator]
    square = float(left @ left) + sum(float(part @ part) for part in drawn)
    return Imitation(imitator.amounts, inside, stiffness, mean, lower, float(np.sqrt(square)))


def _linear(
    free: np.ndarray,
    shown: Predicted,
    imitator: Predicted,
    inside: np.ndarray,
    stiffness: np.ndarray,
) -> tuple[list[np.ndarray], np.ndarray]:
    """All directions that may imitate, by kind, and (P,) what they must imitate."""
    errors = [shown.error / stiffness[0], imitator.error / stiffness[1]]
    blocks = [free, *errors, imitator.law[:, inside]]
    return blocks, shown.change - imitator.law[:, ~inside] @ imitator.amounts[~inside]
