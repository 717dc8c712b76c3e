"""Laws learned from readings: which laws of any form the accepted ones leave unexplained.

They are chosen one after the other by their evidence beside everything that the model may vary,
and kept only if they improve the prediction of readings left out.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

import numpy as np

from paint_deposition.inference.diagnosis.evidence import NullModel, Principal
from paint_deposition.inference.diagnosis.explanations import FOOTPRINT, PLACE, Explanation
from paint_deposition.inference.diagnosis.model_space import SIZES

MOST_LAWS = 2


@dataclass(frozen=True)
class Nulls:
    """What a law of each kind must say more than."""

    # For a footprint: pattern, nuisance, what the accepted laws may be off by, and what nature
    # leaves over of parts and settings.
    footprint: NullModel
    # For a correction of an accepted law: the same with the footprint, without what the laws may
    # be off by.
    correction: NullModel
    # For a map: all of it, with what nature usually leaves over of parts and settings; the most
    # probable may be what is unknown.
    place: NullModel
    any_form: NullModel  # for all others: all of it

    def of(self, explanation: Explanation) -> NullModel:
        """That for an explanation."""
        if explanation.corrects:
            return self.correction
        kinds = {FOOTPRINT: self.footprint, PLACE: self.place}
        return kinds.get(explanation.learns, self.any_form)

    def beside(self, columns: np.ndarray) -> 'Nulls':
        """The same where some directions (P, n) may vary, too."""
        return self._each(lambda null: null.beside(columns))

    def select(self, rows: np.ndarray) -> 'Nulls':
        """The same for some of the readings."""
        return self._each(lambda null: null.select(rows))

    def _each(self, change: Callable[[NullModel], NullModel]) -> 'Nulls':
        return Nulls(*(change(getattr(self, each.name)) for each in fields(self)))


def choose_laws(
    nulls: Nulls, explanations: Sequence[Explanation], freedom: float
) -> list[tuple[int, float]]:
    """The laws that the readings call for, strongest first.

    Args:
        nulls: what varies already.
        explanations: laws of any form, of which one for each covariate is considered.
        freedom: degrees of freedom of the noise estimate.

    Returns:
        The number of each explanation, and the standard deviation of its amplitudes.
    """
    left = {k: e for k, e in enumerate(explanations) if e.learns}
    chosen: list[tuple[int, float]] = []
    while left and len(chosen) < MOST_LAWS:
        worth = [
            (float(value), k, float(size))
            for k, explanation in left.items()
            for value, size in zip(
                by_size(nulls.of(explanation), explanation, freedom), SIZES, strict=True
            )
            if value >= explanation.worth
        ]
        if not worth:
            break
        _, k, size = max(worth)
        chosen.append((k, size))
        # What was chosen may vary from now on, too.
        nulls = nulls.beside(size * left[k].columns)
        left = {number: e for number, e in left.items() if e.learns != left[k].learns}
    return chosen


def by_size(null: NullModel, explanation: Explanation, freedom: float) -> np.ndarray:
    """(S,) log Bayes factor of a law at every size."""
    found = Principal.of(null.whiten(explanation.columns), explanation.sides)
    return found.log_bayes_factors(null.deviation[:, np.newaxis], SIZES, freedom)[:, 0]
