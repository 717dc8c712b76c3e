"""Laws learned from readings: which curves over covariates the accepted laws leave unexplained.

Curves are chosen one after the other by their evidence beside everything that the model may vary,
and kept only if they improve the prediction of readings left out.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from paint_deposition.diagnosis.evidence import KNOWN_NOISE, NullModel, log_bayes_factor
from paint_deposition.diagnosis.explanations import Explanation
from paint_deposition.diagnosis.model_space import SIZES

MOST_CURVES = 2
# A curve must raise the log evidence by this much: it is chosen among some dozens.
WORTH_LEARNING = 6.0


@dataclass(frozen=True)
class ChosenCurve:
    """A curve with its size.

    Attributes:
        explanation: whose directions are curves over a covariate.
        size: standard deviation of its amplitudes.
    """

    explanation: Explanation
    size: float

    @property
    def columns(self) -> np.ndarray:
        """(P, n) directions over the noise, for amplitudes of unit variance."""
        return self.size * self.explanation.columns


def choose_curves(
    null: NullModel, explanations: Sequence[Explanation], freedom: float
) -> list[ChosenCurve]:
    """The curves that the readings call for, strongest first.

    Args:
        null: what varies already: pattern, nuisance and the accepted laws.
        explanations: those with a curve are considered.
        freedom: degrees of freedom of the noise estimate.
    """
    curves = [e for e in explanations if e.curve is not None]
    whitened = [null.whiten(e.columns) for e in curves]
    chosen: list[ChosenCurve] = []
    taken: np.ndarray = np.empty((len(null.deviation), 0))
    value = 0.0
    while len(chosen) < MOST_CURVES:
        options = [
            (_evidence(np.hstack([taken, size * columns]), null, freedom), k, float(size))
            for k, columns in enumerate(whitened)
            for size in SIZES
        ]
        if not options:
            break
        best, k, size = max(options)
        if best < value + WORTH_LEARNING:
            break
        value, taken = best, np.hstack([taken, size * whitened[k]])
        chosen.append(ChosenCurve(curves[k], size))
    return chosen


def _evidence(columns: np.ndarray, null: NullModel, freedom: float) -> float:
    count = columns.shape[1]
    return log_bayes_factor(
        columns.T @ columns, columns.T @ null.deviation, float(null.deviation @ null.deviation),
        np.zeros(count), np.ones(count), min(freedom, 2.0 * KNOWN_NOISE), len(null.deviation),
    )  # fmt: skip
