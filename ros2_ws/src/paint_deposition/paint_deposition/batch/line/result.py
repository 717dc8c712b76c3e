"""The result of a line: a row for each part and point, what the parts share, what changed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from paint_deposition.batch.line.alarms import Alarm, alarms_of
from paint_deposition.batch.line.changes import (
    FEWEST,
    RUN_LENGTH,
    Change,
    Series,
    changes_of,
    date,
    series_of,
)
from paint_deposition.batch.line.part import FIGURES
from paint_deposition.batch.line.picture import line_figure
from paint_deposition.batch.line.pooling import Measured, Pooled, measured_parts, pooled
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import some
from paint_deposition.files.json_files import write_json
from paint_deposition.files.parquet import write_parquet
from paint_deposition.files.provenance import origin
from paint_deposition.inference.fitting.parameters import FreeParameters
from paint_deposition.report.pictures.chart import save_picture
from paint_deposition.report.writers.write import written

if TYPE_CHECKING:
    import pyarrow as pa

# For pooling only.
DERIVATIVES = ('by_pattern', 'by_effect')
# So many of the newest alarms, and of the files without a run, are printed.
MOST_ALARMS = MOST_UNMATCHED = 5
# A model whose mean film is off by more than this share of the readings is not of this line.
OFF_MODEL = 0.3


@dataclass(frozen=True)
class Line:
    """The parts of a line."""

    model: DepositionModel  # of all
    files: Mapping[str, Path]  # shared by all, by what they are
    table: pa.Table  # a row for each part and point, in the order of the runs
    computed: int  # how many runs were computed now
    unmatched: Sequence[str] = ()  # names of files of the folder that belong to no run

    @cached_property
    def parts(self) -> list[Measured]:
        """The measured parts, oldest first."""
        return measured_parts(self.table.to_pylist())

    @cached_property
    def pooled(self) -> Pooled | None:
        """What they share; None with fewer than two."""
        if len(self.parts) < 2:
            return None
        return pooled(self.parts, FreeParameters.of(self.model).pattern)

    @cached_property
    def series(self) -> list[Series]:
        """Level, misfit and amplitudes; none with too few parts."""
        if self.pooled is None or len(self.parts) < FEWEST:
            return []
        return series_of(self.parts, self.pooled)

    @cached_property
    def times_s(self) -> np.ndarray:
        """(n,) of the measured parts."""
        return np.array([part.time_s for part in self.parts])

    @cached_property
    def changes(self) -> list[Change]:
        """Oldest first."""
        return changes_of(self.series, self.times_s) if self.series else []

    @cached_property
    def alarms(self) -> list[Alarm]:
        """Oldest first."""
        return alarms_of(self.series, [part.name for part in self.parts])

    @cached_property
    def runs(self) -> list[dict[str, Any]]:
        """The first row of each part without its point, oldest first."""
        wanted = ('part', 'time_s', 'remark', *(f'film_{name}' for name in FIGURES))
        names = [name for name in wanted if name in self.table.column_names]
        rows = {row['part']: row for row in self.table.select(names).to_pylist()[::-1]}
        dated = [row for row in rows.values() if row.get('time_s') is not None]
        return sorted(dated, key=lambda row: row['time_s'])

    @property
    def errors(self) -> list[tuple[str, str]]:
        """Name of each run that cannot be used, and why."""
        if 'error' not in self.table.column_names:
            return []
        rows = self.table.select(['part', 'error']).to_pylist()
        return [(row['part'], row['error']) for row in rows if row['error']]

    @cached_property
    def remarks(self) -> list[tuple[str, str]]:
        """Name of each part with a remark, and the remark, oldest first."""
        return [(run['part'], run['remark']) for run in self.runs if run.get('remark')]

    @property
    def warnings(self) -> list[str]:
        """What concerns the line as a whole, with its remedy."""
        found = []
        if self.parts:
            predicted_um = float(np.concatenate([p.predicted_um for p in self.parts]).mean())
            off_um = float(np.concatenate([p.residual_um for p in self.parts]).mean())
            measured_um = predicted_um + off_um
            if abs(off_um) > OFF_MODEL * measured_um:
                found.append(
                    f'the model predicts {predicted_um:.0f} µm where the gauge reads '
                    f'{measured_um:.0f} µm; calibrate it for this line (percentages are of the '
                    "model's film)"
                )
        if self.unmatched:
            named = some(self.unmatched, MOST_UNMATCHED)
            found.append(f'no recording has the name of {named}; left out')
        return found

    @property
    def sentence(self) -> str:
        """The line in a line."""
        count, readings = len(self.parts), sum(map(len, self.parts))
        text = f'{len(self.runs)} parts'
        if self.runs:
            text += f' from {date(self.runs[0]["time_s"])} to {date(self.runs[-1]["time_s"])}'
        text += f', {count} of them measured at {readings} points'
        text += f'; {len(self.errors)} runs could not be used' if self.errors else ''
        alarmed = [name for alarm in self.alarms for name in alarm.parts]
        if len(alarmed) == 1:
            text += f'; {alarmed[0]} is in alarm'
        elif alarmed:
            text += f'; {len(alarmed)} parts are in alarm, the newest {alarmed[-1]}'
        return text

    @property
    def lines(self) -> Iterator[str]:
        """The result in lines."""
        yield self.sentence
        if len(self.alarms) > MOST_ALARMS:
            yield f'alarms: {len(self.alarms)}, all in line.json; the newest:'
        yield from (f'alarm: {alarm.sentence}' for alarm in self.alarms[-MOST_ALARMS:])
        if self.pooled is None:
            yield 'nothing is pooled: fewer than two parts were measured'
            return
        scales = self.pooled.posterior.scales
        yield (
            f'the level differs from part to part by {100 * scales.level:.1f} %, the gauge '
            f'scatters by {scales.noise:.2f} times the stated noise'
        )
        yield from (f'shared by all parts: {cause.sentence}' for cause in self.pooled.causes)
        if not self.pooled.causes:
            yield 'no effect shared by all parts was found'
        yield from (f'changed: {change.sentence}' for change in self.changes)
        if not self.series:
            yield f'no charts: fewer than {FEWEST} parts were measured'
        elif not self.changes:
            yield 'nothing changed'

    def to_dict(self) -> dict[str, Any]:
        """The content of ``line.json``."""
        found = self.pooled
        scales = found and found.posterior.scales
        return {
            'parts': len(self.runs),
            'measured': len(self.parts),
            'points': sum(map(len, self.parts)),
            'computed': self.computed,
            'first': date(self.runs[0]['time_s']) if self.runs else None,
            'last': date(self.runs[-1]['time_s']) if self.runs else None,
            'pooled': scales and {
                'level_sd_percent': 100.0 * scales.level,
                'noise_factor': scales.noise,
                'misfit_share': scales.misfit[0] if scales.misfit else 0.0,
                'causes': [asdict(cause) for cause in found.causes] if found else [],
            },
            'charts': [self._chart(one) for one in self.series],
            'alarms': [asdict(alarm) for alarm in self.alarms],
            'false_alarms': {'one_in_parts': RUN_LENGTH},
            'changes': [change.to_dict() for change in self.changes],
            'errors': [{'run': name, 'error': error} for name, error in self.errors],
            'remarks': [{'part': name, 'remark': remark} for name, remark in self.remarks],
            'without_run': list(self.unmatched),
            'warnings': self.warnings,
            'provenance': origin(self.model, self.files),
        }  # fmt: skip

    def _chart(self, series: Series) -> dict[str, Any]:
        drawn = series.charts
        return {
            'series': series.name,
            'unit': series.unit,
            'members': list(series.members),
            'centre': series.centre,
            'baseline_parts': series.baseline,
            'limits': {'shewhart': drawn.shewhart_limit, 'ewma': float(drawn.ewma_limit[-1])},
            'alarms': {
                chart: [self.parts[row].name for row in rows]
                for chart, rows in drawn.alarms.items()
            },
        }


@written.register
def _write(line: Line, folder: Path, pictures: str = 'png') -> list[Path]:
    """Tables, figures and the picture of the charts."""
    table = line.table
    own = [name for name in DERIVATIVES if name in table.column_names]
    files = [
        write_parquet(folder / 'points.parquet', _with_time(table.drop_columns(own))),
        write_parquet(folder / 'parts.parquet', _with_time(_parts(line))),
        folder / 'line.json',
    ]
    write_json(files[-1], line.to_dict())
    if line.series:
        causes = line.pooled.causes if line.pooled else ()
        news = {f'{cause.effect}.{cause.parameter}' for cause in causes}
        figure = line_figure(line.sentence, line.series, line.changes, line.times_s, news)
        files.append(save_picture(figure, folder / f'line.{pictures}'))
    return files


def _parts(line: Line) -> pa.Table:
    """A row for each part: when, its film as computed, and what its readings say."""
    import pyarrow as pa

    measured: dict[str, dict[str, Any]] = {}
    for row, part in enumerate(line.parts):
        readings = measured[part.name] = {'readings': len(part)}
        for series in line.series:
            name = {'level': 'level_percent'}.get(series.name, series.name)
            readings |= {name: float(series.values[row]), f'{name}_sd': float(series.sd[row])}
    empty = dict.fromkeys(next(iter(measured.values()), {})) | {'readings': 0}
    return pa.Table.from_pylist([run | measured.get(run['part'], empty) for run in line.runs])


def _with_time(table: pa.Table) -> pa.Table:
    """With the column ``time_s``, seconds since 1970, also as date and time."""
    import pyarrow as pa

    microseconds = [None if s is None else round(1e6 * s) for s in table['time_s'].to_pylist()]
    return table.append_column('time', pa.array(microseconds, pa.timestamp('us', 'UTC')))
