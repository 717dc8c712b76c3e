"""Cross-validation: how well a fitted model predicts blocks of points that were left out."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from paint_deposition.diagnosis.evidence import NullModel
from paint_deposition.diagnosis.learning import MOST_LAWS, choose_laws
from paint_deposition.diagnosis.model_space import ModelSpace
from paint_deposition.fitting.study import Study

# How many times some of the blocks are left out.
FOLDS = 6


def hold_out(null: NullModel, blocks: np.ndarray) -> np.ndarray:
    """(P,) deviations over the noise of points while their block (P,) was left out."""
    deviation = np.empty(len(blocks))
    for block in np.unique(blocks):
        out = blocks == block
        deviation[out] = left_out(null, [], out)
    return deviation


@dataclass(frozen=True)
class Stage:
    """One step of a search.

    Attributes:
        space: what may be missing at a fit, whose effects' laws may be off.
        plain: the model of that fit, its laws taken as they are.
        accepted: effects that the space called for; none at the last stage.
    """

    space: ModelSpace
    plain: NullModel
    accepted: frozenset[str] = frozenset()


def nested_rmse_um(stages: Sequence[Stage], study: Study) -> np.ndarray:
    """(n,) errors on points left out with effects and 0 to n - 1 laws learned without them [um].

    For each fold the search is repeated on the other points: as long as they call for the same
    effects, it goes on to the next stage; only the linearisations are shared by all folds.

    Args:
        stages: of the search.
        study: the readings; some patches of points at a time are left out.
    """
    blocks = study.patches()
    deviation = np.empty((MOST_LAWS + 1, len(blocks)))
    for fold in np.array_split(np.random.default_rng(0).permutation(np.unique(blocks)), FOLDS):
        out = np.isin(blocks, fold)
        for stage in stages:
            space, part = stage.space, stage.space.select(~out)
            found = part.accepted
            if {cause for cause, _, _ in found} != stage.accepted:
                break
        columns = [size * space.explanations[k].law for _, k, size in found]
        given = np.hstack([stage.plain.columns, *columns])
        null = NullModel.of(given[~out], stage.plain.raw[~out])
        laws = choose_laws(null, part.explanations, space.freedom)
        learned = [size * space.explanations[k].columns for k, size in laws]
        for count in range(MOST_LAWS + 1):
            deviation[count, out] = left_out(stage.plain, columns + learned[:count], out)
    return np.sqrt(np.mean((deviation * study.sigma_um) ** 2, axis=1))


def left_out(null: NullModel, added: Sequence[np.ndarray], out: np.ndarray) -> np.ndarray:
    """Deviations of points from what the others predict, by the model and the levels of parts.

    Args:
        null: what the model varies. added: directions (P, n) of what it has besides.
        out: (P,) bool, the points left out.
    """
    columns = np.hstack([null.columns, *added])
    kept = columns[~out]
    precision = np.eye(columns.shape[1]) + kept.T @ kept
    amounts = np.linalg.solve(precision, kept.T @ null.raw[~out])
    return null.raw[out] - columns[out] @ amounts
