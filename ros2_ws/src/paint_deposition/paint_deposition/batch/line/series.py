"""What each part says by itself, part after part: its level, its misfit, every amplitude."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.stats import chi2, norm

from paint_deposition.batch.line.causes import Pooled
from paint_deposition.batch.line.control_charts import Charts, charts, robust_deviation
from paint_deposition.batch.line.measured import Measured, places
from paint_deposition.batch.line.part import amplitudes
from paint_deposition.effects.catalogue import EFFECTS

# Fewer parts make no chart.
FEWEST = 8
# The first third of the parts, but no more than these, tell where the charts' centre is.
MOST_BASELINE = 100
# All charts together raise one false alarm in so many parts; level, misfit and effects share it.
RUN_LENGTH = 1000.0
CHARTS, SHARES = 3, 3
# An amplitude that one part knows no better than to so many typical sizes is not charted.
VAGUE = 5.0
# Series more alike than this are one.
ALIKE = 0.9
# The chi-square of a part counts as no more standard deviations than this.
FURTHEST = 8.0


@dataclass(frozen=True)
class Series:
    """A quantity of n parts.

    Attributes:
        name: 'level', 'misfit', or an effect's 'id.parameter'.
        unit: of values. members: series that are alike, itself first.
        values, sd: (n,) and what one part's readings leave open, standard deviations.
        baseline: so many first parts tell the centre.
        run_length: of each of its charts.
    """

    name: str
    unit: str
    members: tuple[str, ...]
    values: np.ndarray
    sd: np.ndarray
    baseline: int
    run_length: float

    @cached_property
    def centre(self) -> float:
        """Mean over the baseline, each part by its weight."""
        weight = self.deviation[: self.baseline] ** -2.0
        return float(weight @ self.values[: self.baseline] / weight.sum())

    @cached_property
    def deviation(self) -> np.ndarray:
        """(n,) standard deviation from part to part: by the gauge, and by the parts themselves."""
        own = max(robust_deviation(self.values) ** 2 - float(np.median(self.sd**2)), 0.0)
        return np.sqrt(own + self.sd**2)

    @cached_property
    def standard(self) -> np.ndarray:
        """(n,) deviations from the centre in standard deviations."""
        return (self.values - self.centre) / self.deviation

    @cached_property
    def charts(self) -> Charts:
        """Shewhart, EWMA and CUSUM."""
        return charts(self.standard, self.run_length)


def baseline_of(count: int) -> int:
    """How many first parts tell the centre."""
    return int(np.clip(count // 3, min(FEWEST // 2, count), MOST_BASELINE))


def series_of(parts: Sequence[Measured], pooled: Pooled) -> list[Series]:
    """The level, the misfit, then every amplitude that the parts can tell; oldest part first."""
    noise = pooled.pool.scales.noise
    _, place_of = places(parts)
    rows, first = [], 0
    for part in parts:
        here = place_of[first : first + len(part)]
        first += len(part)
        left = part.residual_um - pooled.shared_um(part, here)
        rows.append(_of_part(part, left, noise))
    level, level_sd, misfit, amounts, amounts_sd = map(np.array, zip(*rows, strict=True))
    names = amplitudes()
    # An accepted effect is charted as a whole.
    mean = pooled.pool.solved(pooled.chosen)[0][pooled.pool.sums.shared.stop :]
    amounts[:, list(pooled.chosen)] += mean
    told = [
        k for k in range(len(names))
        if np.isfinite(amounts[:, k]).all() and np.median(amounts_sd[:, k]) < VAGUE
    ]  # fmt: skip
    groups = _alike(told, amounts / np.where(amounts_sd > 0.0, amounts_sd, 1.0), pooled.chosen)
    base, spending = baseline_of(len(parts)), RUN_LENGTH * CHARTS * SHARES
    found = [
        Series('level', '%', ('level',), 100.0 * level, 100.0 * level_sd, base, spending),
        Series('misfit', 'standard deviations', ('misfit',), misfit, np.ones(len(parts)), base,
               spending),
    ]  # fmt: skip
    for group in groups:
        effect, parameter = names[group[0]]
        info = EFFECTS[effect].parameters()[parameter]
        members = tuple('.'.join(names[k]) for k in group)
        found.append(Series(
            members[0], info['unit'], members,
            info['neutral'] + info['typical'] * amounts[:, group[0]],
            info['typical'] * amounts_sd[:, group[0]], base, spending * len(groups),
        ))  # fmt: skip
    return found


def _of_part(part: Measured, left_um: np.ndarray, noise: float) -> tuple:
    """Level with its deviation; misfit; amplitudes with theirs, whatever the level is."""
    sigma = noise * part.sigma_um
    film, left = part.predicted_um / sigma, left_um / sigma
    marks = part.by_effect / sigma[:, np.newaxis]
    square = film @ film
    level = film @ left / square
    rest = left - level * film
    freedom = max(len(part) - 1, 1)
    # The tail that is smaller is taken, so that neither end is rounded to 0.
    above, below = chi2.logsf(rest @ rest, freedom), chi2.logcdf(rest @ rest, freedom)
    misfit = _quantile(above, below)
    own = marks - np.outer(film, film @ marks / square)
    told = np.einsum('pa,pa->a', own, own)
    with np.errstate(divide='ignore', invalid='ignore'):
        return level, square**-0.5, misfit, own.T @ rest / told, told**-0.5


def _quantile(log_above: float, log_below: float) -> float:
    value = norm.isf(np.exp(log_above)) if log_above < log_below else norm.ppf(np.exp(log_below))
    return float(np.clip(value, -FURTHEST, FURTHEST))


def _alike(told: Sequence[int], standard: np.ndarray, first: Sequence[int]) -> list[list[int]]:
    """Amplitudes whose series are alike, in groups; accepted ones lead theirs."""
    groups: list[list[int]] = []
    for k in sorted(told, key=lambda one: one not in first):
        for group in groups:
            if abs(np.corrcoef(standard[:, group[0]], standard[:, k])[0, 1]) > ALIKE:
                group.append(k)
                break
        else:
            groups.append([k])
    return groups
