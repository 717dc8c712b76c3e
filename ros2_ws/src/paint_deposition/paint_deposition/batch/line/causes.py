"""Which effects all parts of a line share: found one after the other, by their evidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.special import logsumexp

from paint_deposition.batch.line.measured import Measured
from paint_deposition.batch.line.part import amplitudes
from paint_deposition.batch.line.pooling import ONE_BRUSH, Pool, Sums, evidence, likeliest, pools
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.inference.fitting.pattern_vector import PatternVector
from paint_deposition.report.words import unit_words

# An effect is accepted if it is so probable that something of the catalogue acts.
SURE = 0.99
MOST_ACCEPTED = 3
# Effects whose evidence is within this of the best are not told apart (odds of 20 to 1).
TOGETHER = 3.0


@dataclass(frozen=True)
class Cause:
    """An effect that the parts share.

    Attributes:
        effect, parameter, unit: which.
        value, sd: its amplitude and the standard deviation of it.
        probability: that one of ``members`` acts, given what was accepted before.
        members: effects that these readings do not tell from it, itself first.
        one_part: how many standard deviations it is off zero in one part alone, the median.
        all_parts: the same in all parts together.
    """

    effect: str
    parameter: str
    unit: str
    value: float
    sd: float
    probability: float
    members: tuple[str, ...]
    one_part: float
    all_parts: float

    @property
    def sentence(self) -> str:
        """The cause in a line."""
        others = f' (or {", ".join(self.members[1:])})' if len(self.members) > 1 else ''
        size = f'{self.value:.3g} ± {self.sd:.2g} {unit_words(self.unit)}'.rstrip()
        return (
            f'{self.effect}{others}: {self.parameter} {size}; '
            f'{self.all_parts:.1f} standard deviations over all parts, {self.one_part:.1f} in one'
        )

    def to_dict(self) -> dict[str, Any]:
        """All figures by name."""
        return asdict(self) | {'members': list(self.members)}


@dataclass(frozen=True)
class Pooled:
    """What the parts share.

    Attributes:
        causes: accepted effects, in the order found. pool: with the likeliest misfit.
        chosen: numbers of their amplitudes.
    """

    causes: tuple[Cause, ...]
    pool: Pool
    chosen: tuple[int, ...]

    def shared_um(self, part: Measured, places: np.ndarray) -> np.ndarray:
        """(P,) what of a part's residuals is shared [um], for the places of its points."""
        mean = self.pool.solved(self.chosen)[0]
        count = self.pool.sums.shared.stop
        pattern = part.by_pattern.shape[1]
        misfit = part.predicted_um * mean[pattern:count][places]
        effects = part.by_effect[:, list(self.chosen)] @ mean[count:]
        return part.by_pattern @ mean[:pattern] + misfit + effects


def pooled(parts: Sequence[Measured], pattern: PatternVector = ONE_BRUSH) -> Pooled:
    """Find the effects that the parts share; ``pattern`` is that of the model, of all brushes."""
    sums = Sums.of(parts, pattern)
    found, log_share = pools(sums)
    names = amplitudes()
    chosen: tuple[int, ...] = ()
    causes: list[Cause] = []
    while len(causes) < MOST_ACCEPTED:
        # Half of the belief is that nothing (more) acts; the rest is shared by the effects.
        left = [k for k, (e, _) in enumerate(names) if e not in {names[c][0] for c in chosen}]
        nothing = evidence(found, log_share, chosen)
        each = np.array([evidence(found, log_share, (*chosen, k)) for k in left])
        log_odds = float(logsumexp(each) - np.log(len(left)) - nothing)
        probability = float(1.0 / (1.0 + np.exp(-log_odds)))
        if probability < SURE:
            break
        order = np.argsort(-each)
        near = [left[k] for k in order if each[k] > each[order[0]] - TOGETHER]
        members = tuple(dict.fromkeys(names[k][0] for k in near))
        chosen = (*chosen, near[0])
        pool = likeliest(found, log_share, chosen)
        causes.append(_cause(parts, pattern, pool, chosen, probability, members))
    return Pooled(tuple(causes), likeliest(found, log_share, chosen), chosen)


def _cause(
    parts: Sequence[Measured],
    pattern: PatternVector,
    pool: Pool,
    chosen: tuple[int, ...],
    probability: float,
    members: tuple[str, ...],
) -> Cause:
    mean, covariance, _ = pool.solved(chosen)
    value, sd = float(mean[-1]), float(np.sqrt(covariance[-1, -1]))
    effect, parameter = amplitudes()[chosen[-1]]
    info = EFFECTS[effect].parameters()[parameter]
    step = max(len(parts) // 25, 1)
    alone = []
    for part in parts[::step]:
        one = Pool(Sums.of([part], pattern), pool.scales).solved(chosen[-1:])[1][-1, -1]
        # Without the prior of the amplitude, which is standard normal.
        alone.append(abs(value) * np.sqrt(max(1.0 / one - 1.0, 0.0)))
    return Cause(
        effect, parameter, info['unit'], info['neutral'] + info['typical'] * value,
        info['typical'] * sd, probability, members, float(np.median(alone)), abs(value) / sd,
    )  # fmt: skip
