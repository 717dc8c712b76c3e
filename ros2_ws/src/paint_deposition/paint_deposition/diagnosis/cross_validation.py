"""Cross-validation: how well a fitted model predicts blocks of points that were left out."""

from dataclasses import dataclass

import numpy as np

from paint_deposition.fitting.least_squares import Fit


@dataclass(frozen=True)
class HeldOut:
    """Predictions of points while their block was left out.

    Attributes:
        deviation: (P,) measured minus predicted, over the standard deviation of the reading.
        log_score: mean log predictive density of the points left out.
    """

    deviation: np.ndarray
    log_score: float


def hold_out(fit: Fit, blocks: np.ndarray) -> HeldOut:
    """Leave out one block after the other and refit in the linear approximation, priors included.

    Args:
        fit: around which the model is linear.
        blocks: (P,) block of each point.
    """
    centre, width = fit.parameters.prior
    jacobian = fit.jacobian
    target = fit.residual + jacobian @ (fit.vector - centre)
    deviation = np.empty_like(target)
    score = 0.0
    for block in np.unique(blocks):
        out = blocks == block
        kept = jacobian[~out]
        precision = kept.T @ kept + np.diag(width**-2.0)
        moved = np.linalg.solve(precision, kept.T @ target[~out])
        deviation[out] = target[out] - jacobian[out] @ moved
        spread = np.linalg.solve(precision, jacobian[out].T)
        covariance = np.eye(out.sum()) + jacobian[out] @ spread
        _, log_det = np.linalg.slogdet(2.0 * np.pi * covariance)
        solved = np.linalg.solve(covariance, deviation[out])
        score -= 0.5 * (log_det + deviation[out] @ solved)
    return HeldOut(deviation, score / len(target))
