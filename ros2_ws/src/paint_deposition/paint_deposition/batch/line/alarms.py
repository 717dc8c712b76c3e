"""Parts in alarm, in words: which, in what, and what to do about it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from paint_deposition.batch.line.changes import Series
from paint_deposition.report.words import joined

LEVEL = 'compare the gauge with its standard, then check the paint flow'
OTHERWISE = 'diagnose these readings'


@dataclass(frozen=True)
class Alarm:
    """Parts in alarm, one directly after the other."""

    parts: tuple[str, ...]  # their names, oldest first
    series: tuple[str, ...]  # names of what is beyond its limits, the one to act on first
    sentence: str


def alarms_of(series: Sequence[Series], names: Sequence[str]) -> list[Alarm]:
    """All alarms of the charts over parts of these names, oldest first."""
    beyond = np.array([one.charts.in_alarm for one in series])
    rows = np.flatnonzero(beyond.any(axis=0))
    found = []
    for group in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1) if len(rows) else []:
        shown = [one for one, here in zip(series, beyond[:, group], strict=True) if here.any()]
        # The misfit leads only where nothing else is out, since it names no cause.
        shown.sort(key=lambda one: (one.name == 'misfit', -np.abs(one.standard[group]).max()))
        first, last = names[group[0]], names[group[-1]]
        which = first if len(group) == 1 else f'{len(group)} parts, {first} to {last}'
        what = joined([one.words for one in shown[:2]])
        more = f' and {len(shown) - 2} more' if len(shown) > 2 else ''
        remedy = LEVEL if shown[0].name == 'level' else OTHERWISE
        if len(group) == 1:
            remedy = f'measure it again; if it stays so, {remedy}'
        found.append(Alarm(
            tuple(names[row] for row in group), tuple(one.name for one in shown),
            f'{which}: {what}{more}; {remedy}',
        ))  # fmt: skip
    return found
