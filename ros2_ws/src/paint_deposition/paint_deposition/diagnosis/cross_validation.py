"""Cross-validation: how well a fitted model predicts blocks of points that were left out."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from paint_deposition.diagnosis.evidence import NullModel
from paint_deposition.diagnosis.learning import choose_laws
from paint_deposition.diagnosis.model_space import ModelSpace
from paint_deposition.fitting.least_squares import Fit
from paint_deposition.fitting.study import Study
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
    """Leave out one block after the other and refit in the linear approximation, prior included.

    Args:
        fit: around which the model is linear.
        blocks: (P,) block of each point.
    """
    prior = fit.parameters.prior
    target = fit.residual + fit.jacobian @ (fit.vector - prior.centre)
    directions = fit.jacobian @ prior.factor
    deviation = np.empty_like(target)
    score = 0.0
    for block in np.unique(blocks):
        out = blocks == block
        kept = directions[~out]
        precision = np.eye(directions.shape[1]) + kept.T @ kept
        amounts = np.linalg.solve(precision, kept.T @ target[~out])
        deviation[out] = target[out] - directions[out] @ amounts
        spread = np.linalg.solve(precision, directions[out].T)
        covariance = np.eye(out.sum()) + directions[out] @ spread
        _, log_det = np.linalg.slogdet(2.0 * np.pi * covariance)
        solved = np.linalg.solve(covariance, deviation[out])
        score -= 0.5 * (log_det + deviation[out] @ solved)
    return HeldOut(deviation, score / len(target))


@dataclass(frozen=True)
class Stage:
    """One step of a search: what may be missing at a fit, and what was accepted there."""

    space: ModelSpace
    accepted: frozenset[str]


def nested_rmse_um(stages: Sequence[Stage], study: Study, learn: bool) -> float:
    """Error on points left out when effects and learned laws are chosen without them, too [um].

    For each fold the search is repeated on the other points: as long as they call for the same
    effects, it goes on to the next stage; only the linearisations are shared by all folds.

    Args:
        stages: of the search; nothing was accepted at the last one.
        study: the readings; some patches of points at a time are left out.
        learn: whether laws are learned, too, or effects of the library alone.
    """
    blocks = study.patches()
    deviation = np.empty(len(blocks))
    for fold in np.array_split(np.random.default_rng(0).permutation(np.unique(blocks)), FOLDS):
        out = np.isin(blocks, fold)
        for stage in stages:
            space, part = stage.space, stage.space.select(~out)
            found = part.accepted
            if {cause for cause, _, _ in found} != stage.accepted:
                break
        columns = [size * space.explanations[k].law for _, k, size in found]
        if learn:
            columns += _learned(space, part, columns, ~out)
        deviation[out] = left_out(space.null, columns, out)
    return root_mean_square(deviation * study.sigma_um)


def left_out(null: NullModel, added: Sequence[np.ndarray], out: np.ndarray) -> np.ndarray:
    """Deviations of points from what the others predict; levels of parts do not help.

    Args:
        null: what the model varies. added: directions (P, n) of what it has besides.
        out: (P,) bool, the points left out.
    """
    columns = np.hstack([null.columns, *added])
    kept = columns[~out]
    precision = np.eye(columns.shape[1]) + kept.T @ kept
    amounts = np.linalg.solve(precision, kept.T @ null.raw[~out])
    stop = null.columns.shape[1]
    amounts[stop - null.nuisance : stop] = 0.0
    return null.raw[out] - columns[out] @ amounts


def _learned(
    space: ModelSpace, part: ModelSpace, columns: list[np.ndarray], rows: np.ndarray
) -> list[np.ndarray]:
    """Directions (P, n) of the laws that some readings (P,) bool call for beside others."""
    given = np.hstack([part.null.columns, *(c[rows] for c in columns)])
    null = NullModel.of(given, part.null.raw)
    laws = choose_laws(null, part.explanations, space.freedom)
    return [size * space.explanations[k].columns for k, size in laws]
