"""When a series changed: steps and beginning drifts, each with its date."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from typing import Any

import numpy as np

from paint_deposition.line.series import Series

# A segment has at least so many parts.
SHORTEST = 3
# One part counts as no more than this: a single bad part is no change [standard deviations].
MOST_OF_ONE = 4.0
# A change may have been wherever the squared error is larger by no more (95 %, two parameters).
LIKELY = 5.99
SECONDS_A_DAY = 86400.0


@dataclass(frozen=True)
class Change:
    """One change of a series.

    Attributes:
        series, unit, members: of what. kind: 'step' or 'drift'.
        part: row of the first part after it. time_s: of that part; earliest_s, latest_s: within
            which it lies with 95 %.
        before, after: means (of a drift: at its beginning and at the end). sd: of their
            difference. per_day: of a drift, else None.
        strength: the difference in standard deviations of it.
    """

    series: str
    unit: str
    members: tuple[str, ...]
    kind: str
    part: int
    time_s: float
    earliest_s: float
    latest_s: float
    before: float
    after: float
    sd: float
    per_day: float | None
    strength: float

    @property
    def sentence(self) -> str:
        """The change in a line."""
        if self.series == 'level':
            what = 'the film level (K1, or the gain of the gauge)'
        elif self.series == 'misfit':
            what = 'the misfit of the film'
        else:
            others = f' (or {", ".join(self.members[1:])})' if len(self.members) > 1 else ''
            what = f'{self.series}{others}'
        way = 'rose' if self.after > self.before else 'fell'
        size = f'{abs(self.after - self.before):.3g} ± {self.sd:.2g} {self.unit}'
        within = f'between {date(self.earliest_s)} and {date(self.latest_s)}'
        if self.kind == 'drift':
            return f'{what} {way} since {date(self.time_s)} by {size} in all ({within})'
        return f'{what} {way} by {size} on {date(self.time_s)} ({within})'

    def to_dict(self) -> dict[str, Any]:
        """All figures by name, with dates."""
        named = {key: getattr(self, key) for key in self.__dataclass_fields__}
        dates = {name: date(named.pop(f'{name}_s')) for name in ('time', 'earliest', 'latest')}
        return named | dates | {'members': list(self.members), 'sentence': self.sentence}


def date(time_s: float) -> str:
    """'2026-11-12 07:30', UTC."""
    return datetime.fromtimestamp(time_s, timezone.utc).strftime('%Y-%m-%d %H:%M')


def changes_of(series: Sequence[Series], times_s: np.ndarray) -> list[Change]:
    """All changes, oldest first.

    A change has to lower the squared error by twice the logarithm of the parts, which pays for
    looking at all places (BIC), and of the series, which pays for looking at all of them.
    """
    penalty = 2.0 * np.log(len(times_s)) + 2.0 * np.log(len(series))
    found = [change for one in series for change in _of_series(one, times_s, penalty)]
    return sorted(found, key=lambda change: change.time_s)


def _of_series(series: Series, times_s: np.ndarray, penalty: float) -> list[Change]:
    from ruptures import KernelCPD

    values = np.clip(series.standard, -MOST_OF_ONE, MOST_OF_ONE)
    if len(values) < 2 * SHORTEST:
        return []
    ends = KernelCPD(kernel='linear', min_size=SHORTEST).fit(values).predict(pen=penalty)
    starts = [0, *ends[:-1]]
    steps_cost = sum(_scatter(values[a:b]) for a, b in zip(starts, ends, strict=True))
    steps_cost += penalty * (len(ends) - 1)
    drift = _drift(values, times_s)
    if drift[0] + penalty < min(steps_cost, _scatter(values)):
        return [_as_drift(series, times_s, drift[1], penalty)]
    return [
        _as_step(series, values, times_s, starts[k - 1], starts[k], ends[k])
        for k in range(1, len(starts))
    ]


def _scatter(values: np.ndarray) -> float:
    return float(np.sum((values - values.mean()) ** 2))


def _hinge(times_s: np.ndarray, row: int) -> np.ndarray:
    """(n, 2) level, and time since a part."""
    return np.column_stack([np.ones(len(times_s)), np.maximum(times_s - times_s[row], 0.0)])


def _drift(values: np.ndarray, times_s: np.ndarray) -> tuple[float, int]:
    """Least squared error of a line that leaves the level at a part, and that part's row."""
    rows = range(len(values) - SHORTEST)
    errors = [_line_error(_hinge(times_s, row), values) for row in rows]
    best = int(np.argmin(errors))
    return float(errors[best]), best


def _line_error(columns: np.ndarray, values: np.ndarray) -> float:
    scaled = columns / np.maximum(np.abs(columns).max(axis=0), 1e-30)
    fitted = scaled @ np.linalg.lstsq(scaled, values, rcond=None)[0]
    return float(np.sum((values - fitted) ** 2))


def _as_drift(series: Series, times_s: np.ndarray, row: int, penalty: float) -> Change:
    weight = 1.0 / series.deviation
    columns = _hinge(times_s, row)
    columns[:, 1] /= SECONDS_A_DAY
    scaled = columns * weight[:, np.newaxis]
    (level, slope), *_ = np.linalg.lstsq(scaled, series.values * weight, rcond=None)
    sd = float(np.sqrt(np.linalg.inv(scaled.T @ scaled)[1, 1]))
    days = float(columns[-1, 1])
    values = np.clip(series.standard, -MOST_OF_ONE, MOST_OF_ONE)
    errors = [_line_error(_hinge(times_s, k), values) for k in range(len(values) - SHORTEST)]
    likely = np.flatnonzero(np.array(errors) <= min(errors) + LIKELY)
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
    likely = splits[errors <= errors.min() + LIKELY]
    return Change(
        series.name, series.unit, series.members, 'step', row, float(times_s[row]),
        float(times_s[likely[0]]), float(times_s[likely[-1]]), before, after, sd, None,
        abs(after - before) / sd,
    )  # fmt: skip
