"""Laws learned from readings: which laws of any form the accepted ones leave unexplained.

They are chosen one after the other by their evidence beside everything that the model may vary,
and kept only if they improve the prediction of readings left out.
"""

from collections.abc import Sequence

import numpy as np

from paint_deposition.inference.diagnosis.evidence import NullModel, Principal
from paint_deposition.inference.diagnosis.explanations import FOOTPRINT, Explanation
from paint_deposition.inference.diagnosis.model_space import SIZES

MOST_LAWS = 2
# A law must raise the log evidence by this much: it is chosen among some dozens.
WORTH_LEARNING = 6.0


def choose_laws(
    null: NullModel, footprint: np.ndarray, explanations: Sequence[Explanation], freedom: float
) -> list[tuple[int, float]]:
    """The laws that the readings call for, strongest first.

    Args:
        null: what varies already: pattern, nuisance, the accepted laws, and what nature leaves
            over of parts and settings.
        footprint: (P, P) covariance of the deviations of a footprint. A law over a covariate must
            say more than any footprint could.
        explanations: laws of any form, of which one for each covariate is considered.
        freedom: degrees of freedom of the noise estimate.

    Returns:
        The number of each explanation, and the standard deviation of its amplitudes.
    """
    left = {k: e for k, e in enumerate(explanations) if e.learns}
    chosen: list[tuple[int, float]] = []
    while left and len(chosen) < MOST_LAWS:
        beside = null.with_more(footprint)
        gain, k, size = max(
            (float(value), k, float(size))
            for k, explanation in left.items()
            for of in [null if explanation.learns == FOOTPRINT else beside]
            for value, size in zip(by_size(of, explanation, freedom), SIZES, strict=True)
        )
        if gain < WORTH_LEARNING:
            break
        chosen.append((k, size))
        # What was chosen may vary from now on, too.
        null = null.beside(size * left[k].columns)
        left = {number: e for number, e in left.items() if e.learns != left[k].learns}
    return chosen


def by_size(null: NullModel, explanation: Explanation, freedom: float) -> np.ndarray:
    """(S,) log Bayes factor of a law at every size."""
    found = Principal.of(null.whiten(explanation.columns), explanation.sides)
    return found.log_bayes_factors(null.deviation[:, np.newaxis], SIZES, freedom)[:, 0]
