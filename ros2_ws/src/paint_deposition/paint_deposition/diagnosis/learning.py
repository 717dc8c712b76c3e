"""Laws learned from readings: which laws of any form the accepted ones leave unexplained.

They are chosen one after the other by their evidence beside everything that the model may vary,
and kept only if they improve the prediction of readings left out.
"""

from collections.abc import Sequence

import numpy as np

from paint_deposition.diagnosis.evidence import NullModel, evidence
from paint_deposition.diagnosis.explanations import Explanation
from paint_deposition.diagnosis.model_space import SIZES

MOST_LAWS = 3
# A law must raise the log evidence by this much: it is chosen among some dozens.
WORTH_LEARNING = 6.0


def choose_laws(
    null: NullModel, explanations: Sequence[Explanation], freedom: float
) -> list[tuple[int, float]]:
    """The laws that the readings call for, strongest first.

    Args:
        null: what varies already: pattern, nuisance and the accepted laws.
        explanations: those with a random law are considered, one for each covariate.
        freedom: degrees of freedom of the noise estimate.

    Returns:
        The number of each explanation, and the standard deviation of its amplitudes.
    """
    left = {
        k: (explanation.random.basis.law, null.whiten(explanation.columns))
        for k, explanation in enumerate(explanations)
        if explanation.random is not None
    }
    chosen: list[tuple[int, float]] = []
    taken: np.ndarray = np.empty((len(null.deviation), 0))
    value = 0.0
    while left and len(chosen) < MOST_LAWS:
        best, k, size = max(
            (evidence(np.hstack([taken, size * columns]), null, freedom), k, float(size))
            for k, (_, columns) in left.items()
            for size in SIZES
        )
        if best < value + WORTH_LEARNING:
            break
        law, columns = left[k]
        value, taken = best, np.hstack([taken, size * columns])
        chosen.append((k, size))
        left = {number: entry for number, entry in left.items() if entry[0] is not law}
    return chosen
