"""Series over the parts of a line (level, misfit, amplitudes), and their steps and drifts."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from functools import cached_property
from typing import Any

import numpy as np
from scipy.ndimage import median_filter
from scipy.stats import chi2, norm

from paint_deposition.batch.line.control_charts import Charts, charts, robust_deviation
from paint_deposition.batch.line.pooling import Measured, Pooled, amplitudes, places
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.report.words import amplitude_name, unit_words, with_others

# Fewer parts make no chart.
FEWEST = 8
# The first third of the parts, but no more than these, give the charts' centre.
MOST_BASELINE = 100
# All charts together raise one false alarm in so many parts; level, misfit and effects share it.
RUN_LENGTH = 1000.0
CHARTS, SHARES = 2, 3
# An amplitude whose standard deviation from one part is more typical sizes is not charted.
MOST_UNCERTAIN = 5.0
# Amplitudes whose series are correlated by more than this share a chart.
CORRELATED = 0.9
# The misfit of a part is limited to so many standard deviations.
MOST_SIGMAS = 8.0
# A segment has at least so many parts.
SHORTEST_SEGMENT = 3
# A value is limited to so many standard deviations from the median of its neighbours: a single bad
# part is no change.
SPIKE_SIGMAS = 4.0
SPIKE_WINDOW = 5
# The 95 % interval of a change: where the squared error rises by no more (two parameters).
INTERVAL_RISE = 5.99
SECONDS_A_DAY = 86400.0


@dataclass(frozen=True)
class Series:
    """A quantity of n parts."""

    name: str  # 'level', 'misfit', or an effect's 'id.parameter'
    unit: str  # of values
    members: tuple[str, ...]  # correlated amplitudes that share the chart, itself first
    # (n,) estimate from each part alone, and its standard deviation.
    values: np.ndarray
    sd: np.ndarray
    baseline: int  # number of first parts that give the centre
    run_length: float  # of each of its charts

    @property
    def words(self) -> str:
        """What it is called."""
        known = {'level': 'film level', 'misfit': 'misfit of the film'}
        return known.get(self.name) or amplitude_name(self.name)

    @cached_property
    def centre(self) -> float:
        """Mean over the baseline, each part by its weight."""
        weight = self.deviation[: self.baseline] ** -2.0
        return float(weight @ self.values[: self.baseline] / weight.sum())

    @cached_property
    def deviation(self) -> np.ndarray:
        """(n,) standard deviation of a value: of its estimate, and between parts."""
        own = max(robust_deviation(self.values) ** 2 - float(np.median(self.sd**2)), 0.0)
        return np.sqrt(own + self.sd**2)

    @cached_property
    def standard(self) -> np.ndarray:
        """(n,) deviations from the centre in standard deviations."""
        return (self.values - self.centre) / self.deviation

    @cached_property
    def charts(self) -> Charts:
        """Shewhart and EWMA charts."""
        return charts(self.standard, self.run_length)


def series_of(parts: Sequence[Measured], pooled: Pooled) -> list[Series]:
    """The level, the misfit, then every amplitude that one part determines; oldest part first."""
    rows = [
        _part_estimates(part, part.residual_um - pooled.shared_um(part, place_of))
        for part, place_of in zip(parts, places(parts)[1], strict=True)
    ]
    level, level_sd, square, freedom, amounts, amounts_sd = map(np.array, zip(*rows, strict=True))
    # The noise of the parts in the middle: one bad part would make all others look too good.
    noise = np.sqrt(np.median(square / chi2.median(freedom)))
    level_sd, amounts_sd = noise * level_sd, noise * amounts_sd
    misfit = _quantile(square / noise**2, freedom)
    names = amplitudes()
    # An accepted effect is charted as a whole.
    amounts[:, list(pooled.chosen)] += pooled.amplitude_means
    known = [
        k for k in range(len(names))
        if np.isfinite(amounts[:, k]).all() and np.median(amounts_sd[:, k]) < MOST_UNCERTAIN
    ]  # fmt: skip
    groups = _grouped(known, amounts / np.where(amounts_sd > 0.0, amounts_sd, 1.0), pooled.chosen)
    spending = RUN_LENGTH * CHARTS * SHARES
    base = int(np.clip(len(parts) // 3, min(FEWEST // 2, len(parts)), MOST_BASELINE))
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


def _part_estimates(part: Measured, left_um: np.ndarray) -> tuple:
    """Level and its deviation; chi-square of the rest and its freedom; amplitudes and theirs.

    The level is fitted with each amplitude; all deviations are with the stated noise.
    """
    film, left = part.predicted_um / part.sigma_um, left_um / part.sigma_um
    marks = part.by_effect / part.sigma_um[:, np.newaxis]
    square = film @ film
    level = film @ left / square
    rest = left - level * film
    own = marks - np.outer(film, film @ marks / square)
    squares = np.einsum('pa,pa->a', own, own)
    with np.errstate(divide='ignore', invalid='ignore'):
        amounts = own.T @ rest / squares, squares**-0.5
    return level, square**-0.5, rest @ rest, max(len(part) - 1, 1), *amounts


def _quantile(square: np.ndarray, freedom: np.ndarray) -> np.ndarray:
    """(n,) standard normal quantiles of chi-squares; of the smaller tail, so that none is 0."""
    above, below = chi2.logsf(square, freedom), chi2.logcdf(square, freedom)
    value = np.where(above < below, norm.isf(np.exp(above)), norm.ppf(np.exp(below)))
    return np.clip(value, -MOST_SIGMAS, MOST_SIGMAS)


def _grouped(known: Sequence[int], standard: np.ndarray, first: Sequence[int]) -> list[list[int]]:
    """Amplitudes grouped by correlated series; an accepted one leads its group."""
    groups: list[list[int]] = []
    for k in sorted(known, key=lambda one: one not in first):
        for group in groups:
            if abs(np.corrcoef(standard[:, group[0]], standard[:, k])[0, 1]) > CORRELATED:
                group.append(k)
                break
        else:
            groups.append([k])
    return groups


@dataclass(frozen=True)
class Change:
    """One change of a series."""

    # Of what.
    series: str
    unit: str
    members: tuple[str, ...]
    kind: str  # 'step' or 'drift'
    part: int  # row of the first part after it
    time_s: float  # of that part
    # Its 95 % interval.
    earliest_s: float
    latest_s: float
    # Means (of a drift: at its beginning and at the end).
    before: float
    after: float
    sd: float  # of their difference
    per_day: float | None  # of a drift, else None
    strength: float  # the difference in standard deviations of it
    # Weaker series that changed with it; their effects look alike on the film.
    also: tuple[str, ...] = ()

    @property
    def sentence(self) -> str:
        """The change in a line."""
        if self.series == 'level':
            what = 'the film level (K1, or the gain of the gauge)'
        elif self.series == 'misfit':
            what = 'the misfit of the film'
        else:
            what = with_others(list(map(amplitude_name, self.members)))
        way = 'rose' if self.after > self.before else 'fell'
        moved = abs(self.after - self.before)
        size = f'{moved:.3g} ± {self.sd:.2g} {unit_words(self.unit)}'.rstrip()
        first, last, likely = map(date, (self.earliest_s, self.latest_s, self.time_s))
        when = f'with the part of {likely}'
        if first != last:
            when = f'between {first} and {last}, most likely {when}'
        charts = 'another chart' if len(self.also) == 1 else f'{len(self.also)} other charts'
        others = f'; {charts} changed with it' if self.also else ''
        began = ' in all, beginning' if self.kind == 'drift' else ''
        return f'{what} {way} by {size}{began} {when}{others}'

    def to_dict(self) -> dict[str, Any]:
        """All figures by name, with dates."""
        named = {key: getattr(self, key) for key in self.__dataclass_fields__}
        dates = {name: date(named.pop(f'{name}_s')) for name in ('time', 'earliest', 'latest')}
        return named | dates | {'sentence': self.sentence}


def date(time_s: float) -> str:
    """'2026-11-12 07:30', UTC."""
    return datetime.fromtimestamp(time_s, timezone.utc).strftime('%Y-%m-%d %H:%M')


def changes_of(series: Sequence[Series], times_s: np.ndarray) -> list[Change]:
    """All changes, oldest first; concurrent weaker ones are listed with the strongest.

    A change must lower the squared error by twice the logarithm of the number of parts (BIC, for
    the choice of its place) plus twice that of the number of series (for the choice of one).
    """
    penalty = 2.0 * np.log(len(times_s)) + 2.0 * np.log(len(series))
    found = [change for one in series for change in _changes_in(one, times_s, penalty)]
    return sorted(_merge_concurrent(found), key=lambda change: change.time_s)


def _merge_concurrent(found: Sequence[Change]) -> list[Change]:
    """Concurrent changes as one, named for the strongest: effects look alike on the film.

    The misfit leads only where nothing else changed, since it names no cause.
    """
    leaders: list[Change] = []
    for change in sorted(found, key=lambda one: (one.series == 'misfit', -one.strength)):
        for row, leader in enumerate(leaders):
            ends = leader.latest_s if leader.kind == 'step' else np.inf
            if change.latest_s >= leader.earliest_s and change.earliest_s <= ends:
                also = tuple(dict.fromkeys((*leader.also, change.series)))
                leaders[row] = replace(leader, also=also)
                break
        else:
            leaders.append(change)
    return leaders


def _changes_in(series: Series, times_s: np.ndarray, penalty: float) -> list[Change]:
    from ruptures import KernelCPD

    # Each is limited to a range about the median of its neighbours.
    middle = median_filter(series.standard, SPIKE_WINDOW, mode='nearest')
    values = np.clip(series.standard, middle - SPIKE_SIGMAS, middle + SPIKE_SIGMAS)
    if len(values) < 2 * SHORTEST_SEGMENT:
        return []
    ends = KernelCPD(kernel='linear', min_size=SHORTEST_SEGMENT).fit(values).predict(pen=penalty)
    starts = [0, *ends[:-1]]
    steps_cost = sum(_scatter(values[a:b]) for a, b in zip(starts, ends, strict=True))
    steps_cost += penalty * (len(ends) - 1)
    errors = _drift_errors(values, times_s)
    if errors.min() + penalty < min(steps_cost, _scatter(values)):
        return [_as_drift(series, times_s, errors)]
    return [
        _as_step(series, values, times_s, starts[k - 1], starts[k], ends[k])
        for k in range(1, len(starts))
    ]


def _scatter(values: np.ndarray) -> float:
    return float(np.sum((values - values.mean()) ** 2))


def _drift_errors(values: np.ndarray, times_s: np.ndarray) -> np.ndarray:
    """(n - SHORTEST,) least squared error of a line that leaves the level at each part."""
    began = times_s[: len(times_s) - SHORTEST_SEGMENT]
    since = np.maximum(times_s[:, np.newaxis] - began, 0.0)
    since -= since.mean(axis=0)
    left = values - values.mean()
    squares = np.sum(since**2, axis=0)
    # No drift is told among parts of one time.
    return left @ left - (left @ since) ** 2 / np.where(squares > 0.0, squares, 1.0)


def _as_drift(series: Series, times_s: np.ndarray, errors: np.ndarray) -> Change:
    row = int(np.argmin(errors))
    weight = 1.0 / series.deviation
    since = np.maximum(times_s - times_s[row], 0.0) / SECONDS_A_DAY
    scaled = np.column_stack([np.ones(len(since)), since]) * weight[:, np.newaxis]
    (level, slope), *_ = np.linalg.lstsq(scaled, series.values * weight, rcond=None)
    sd = float(np.sqrt(np.linalg.inv(scaled.T @ scaled)[1, 1]))
    days = float(since[-1])
    likely = np.flatnonzero(errors <= errors.min() + INTERVAL_RISE)
    return Change(
        series.name, series.unit, series.members, 'drift', row, float(times_s[row]),
        float(times_s[likely[0]]), float(times_s[likely[-1]]), float(level),
        float(level + slope * days), sd * days, float(slope), float(abs(slope) / sd),
    )  # fmt: skip


def _as_step(
    series: Series, values: np.ndarray, times_s: np.ndarray, first: int, row: int, end: int
) -> Change:
    weight = series.deviation**-2.0
    before, after = (
        float(np.average(series.values[a:b], weights=weight[a:b]))
        for a, b in ((first, row), (row, end))
    )
    sd = float(np.sqrt(1.0 / weight[first:row].sum() + 1.0 / weight[row:end].sum()))
    splits = np.arange(first + 1, end)
    errors = np.array([_scatter(values[first:k]) + _scatter(values[k:end]) for k in splits])
    likely = splits[errors <= errors.min() + INTERVAL_RISE]
    return Change(
        series.name, series.unit, series.members, 'step', row, float(times_s[row]),
        float(times_s[likely[0]]), float(times_s[likely[-1]]), before, after, sd, None,
        abs(after - before) / sd,
    )  # fmt: skip
