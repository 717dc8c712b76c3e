"""Cross-validation: how well a fitted model predicts readings that were left out."""

from collections.abc import Sequence

import numpy as np

from paint_deposition.inference.diagnosis.explanations import Explanation
from paint_deposition.inference.diagnosis.learning import MOST_LAWS, choose_laws
from paint_deposition.inference.diagnosis.search import Stage
from paint_deposition.inference.diagnosis.trial import Trial
from paint_deposition.inference.readings.residuals import root_mean_square


class LeftOut:
    """Errors on readings left out, of a search and the laws learned after it.

    For each fold the choice is repeated with the other readings between the sets of effects that
    were tried: as long as it is the same, it goes on to the next stage. The fits of the sets are
    shared by all folds.

    Args:
        stages: of the search.
        options: laws of any form that may be learned.
    """

    def __init__(self, stages: Sequence[Stage], options: Sequence[Explanation]) -> None:
        self.stages, self.options = stages, options
        self._known: dict[tuple[frozenset[str], bool], np.ndarray] = {}

    def errors_um(
        self, without: frozenset[str] = frozenset(), patches: bool = False
    ) -> np.ndarray:
        """(n,) with effects and 0 to n - 1 laws, all found without what is left out [um].

        Args:
            without: covariates of laws that are not learned.
            patches: leave out patches of parts, even where there are several parts.
        """
        key = without, patches
        if key not in self._known:
            study = self.stages[0].here.run.study
            folds = study.patches() if patches else study.folds()
            self._known[key] = self._errors_um(folds, without)
        return self._known[key]

    def _errors_um(self, folds: np.ndarray, without: frozenset[str]) -> np.ndarray:
        run = self.stages[0].here.run
        options = [option for option in self.options if option.learns not in without]
        predicted_um = np.empty((MOST_LAWS + 1, len(folds)))
        for fold in np.unique(folds):
            out = folds == fold
            found = _found_without(self.stages, out)
            nulls = found.nulls(found.fit).select(~out)
            kept = [option.select(~out) for option in options]
            laws = choose_laws(nulls, kept, run.freedom)
            learned = [size * options[k].columns for k, size in laws]
            for count in range(MOST_LAWS + 1):
                if count <= len(learned):
                    free = np.hstack(learned[:count]) if count else None
                    without_um = run.study.predicted_without_um(found.fit, out, free)
                predicted_um[count, out] = without_um[out]
        return np.array([root_mean_square(run.study.measured_um - each) for each in predicted_um])


def _found_without(stages: Sequence[Stage], out: np.ndarray) -> Trial:
    """The set of effects that is found while some readings (P,) are left out."""
    for stage, following in zip(stages, [*stages[1:], None], strict=True):
        chosen = stage.chosen(~out)
        if following is None or chosen.names != following.here.names:
            break
    return chosen
