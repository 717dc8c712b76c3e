"""Cross-validation: how well a fitted model predicts readings that were left out."""

from collections.abc import Collection, Sequence

import numpy as np

from paint_deposition.inference.diagnosis.evidence import left_out
from paint_deposition.inference.diagnosis.explanations import Explanation
from paint_deposition.inference.diagnosis.learning import MOST_LAWS, choose_laws
from paint_deposition.inference.diagnosis.search import Stage, Trial
from paint_deposition.inference.readings.residuals import root_mean_square


def nested_rmse_um(
    stages: Sequence[Stage], options: Sequence[Explanation], without: Collection[str] = ()
) -> np.ndarray:
    """(n,) errors on readings left out with effects and 0 to n - 1 laws learned without them [um].

    For each fold the choice is repeated with the other readings between the sets of effects that
    were tried: as long as it is the same, it goes on to the next stage. The fits of the sets are
    shared by all folds.

    Args:
        stages: of the search.
        options: laws of any form that may be learned.
        without: covariates of laws that are not learned.
    """
    run = stages[0].here.run
    folds = run.study.folds()
    options = [option for option in options if option.learns not in without]
    deviation = np.empty((MOST_LAWS + 1, len(folds)))
    for fold in np.unique(folds):
        out = folds == fold
        found = _found_without(stages, out)
        plain = run.plain(found.fit)
        beside = found.beside(found.fit).select(~out)
        footprint = found.remainder.of_footprint(found.best.sizes)[np.ix_(~out, ~out)]
        kept = [option.select(~out) for option in options]
        laws = choose_laws(beside, footprint, kept, run.freedom)
        learned = [size * options[k].columns for k, size in laws]
        for count in range(MOST_LAWS + 1):
            deviation[count, out] = left_out(plain, learned[:count], out)
    return np.array([root_mean_square(each * run.study.sigma_um) for each in deviation])


def _found_without(stages: Sequence[Stage], out: np.ndarray) -> Trial:
    """The set of effects that is found while some readings (P,) are left out."""
    for stage, following in zip(stages, [*stages[1:], None], strict=True):
        chosen = stage.chosen(~out)
        if following is None or chosen is not following.here:
            break
    return chosen
