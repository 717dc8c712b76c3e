"""Cross-validation: how well a fitted model predicts blocks of points that were left out."""

from dataclasses import dataclass

import numpy as np

from paint_deposition.diagnosis.evidence import NullModel
from paint_deposition.diagnosis.learning import choose_curves
from paint_deposition.diagnosis.model_space import ModelSpace
from paint_deposition.fitting.least_squares import Fit
from paint_deposition.readings.residuals import root_mean_square

# How many times some of the blocks are left out.
FOLDS = 6


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


def nested_rmse_um(
    space: ModelSpace, blocks: np.ndarray, sigma_um: np.ndarray, curves: bool
) -> float:
    """Error on points left out when causes and curves are chosen without them, too [um].

    Args:
        space: of models around a fit; only its linearisation is shared by all choices.
        blocks: (P,) block of each point; some blocks at a time are left out.
        sigma_um: (P,) standard deviations of the points.
        curves: whether curves are learned, too, or effects of the library alone.
    """
    null = space.null
    deviation = np.empty(len(blocks))
    for fold in np.array_split(np.random.default_rng(0).permutation(np.unique(blocks)), FOLDS):
        out = np.isin(blocks, fold)
        columns = np.hstack([null.columns, *_chosen_columns(space, ~out, curves)])
        kept = columns[~out]
        precision = np.eye(columns.shape[1]) + kept.T @ kept
        amounts = np.linalg.solve(precision, kept.T @ null.raw[~out])
        deviation[out] = null.raw[out] - columns[out] @ amounts
    return root_mean_square(deviation * sigma_um)


def _chosen_columns(space: ModelSpace, rows: np.ndarray, curves: bool) -> list[np.ndarray]:
    """Directions (P, n) of the effects and curves that some readings (P,) bool call for."""
    part = space.select(rows)
    chosen = [size * space.explanations[k].law for _, k, size in part.accepted]
    if not curves:
        return chosen
    null = NullModel.of(
        np.hstack([part.null.columns, *(columns[rows] for columns in chosen)]), part.null.raw
    )
    learned = choose_curves(null, part.explanations, space.freedom)
    whole = {
        id(few): full for few, full in zip(part.explanations, space.explanations, strict=True)
    }
    return chosen + [curve.size * whole[id(curve.explanation)].columns for curve in learned]
