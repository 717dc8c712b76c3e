"""Cross-validation: how well a fitted model predicts points that were left out."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from paint_deposition.inference.diagnosis.evidence import NullModel
from paint_deposition.inference.diagnosis.learning import MOST_LAWS, choose_laws
from paint_deposition.inference.diagnosis.model_space import ModelSpace
from paint_deposition.inference.fitting.study import Study


def hold_out(null: NullModel, folds: np.ndarray) -> np.ndarray:
    """(P,) deviations over the noise of points while those of their fold (P,) were left out."""
    deviation = np.empty(len(folds))
    for fold in np.unique(folds):
        out = folds == fold
        deviation[out] = left_out(null, [], out)
    return deviation


@dataclass(frozen=True)
class Stage:
    """One step of a search.

    Attributes:
        space: what may be missing at a fit, whose effects' laws may be off.
        plain: the model of that fit, its laws taken as they are.
        accepted: effects that were added after it; none at the last stage.
        shapeless: whether they took the place of a shapeless cause that the space called for.
    """

    space: ModelSpace
    plain: NullModel
    accepted: frozenset[str] = frozenset()
    shapeless: bool = False

    def goes_on(self, part: ModelSpace) -> bool:
        """Whether the same effects would be added with the space of a part of the readings."""
        found = frozenset(cause for cause, _, _ in part.accepted)
        if self.shapeless:
            return not found and part.is_shapeless
        return bool(found) and found == self.accepted


def nested_rmse_um(
    stages: Sequence[Stage], study: Study, without: Collection[str] = ()
) -> np.ndarray:
    """(n,) errors on points left out with effects and 0 to n - 1 laws learned without them [um].

    For each fold the search is repeated on the other points: as long as they call for the same
    effects, it goes on to the next stage; only the linearisations are shared by all folds.

    Args:
        stages: of the search.
        study: the readings.
        without: covariates of laws that are not learned.
    """
    folds = study.folds()
    deviation = np.empty((MOST_LAWS + 1, len(folds)))
    for fold in np.unique(folds):
        out = folds == fold
        for stage in stages:
            space, part = stage.space, stage.space.select(~out)
            if not stage.goes_on(part):
                break
        found = part.accepted
        columns = [size * space.explanations[k].law for _, k, size in found]
        given = np.hstack([stage.plain.columns, *columns])
        null = NullModel.of(given[~out], stage.plain.raw[~out])
        options = [k for k, e in enumerate(space.explanations) if e.learns not in without]
        laws = choose_laws(null, [part.explanations[k] for k in options], space.freedom)
        learned = [size * space.explanations[options[k]].columns for k, size in laws]
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
