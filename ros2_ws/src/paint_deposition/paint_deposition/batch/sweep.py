"""A sweep: its cases computed, a row for each, and its files."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor
from contextlib import nullcontext
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from paint_deposition.batch.cases import compute, workers
from paint_deposition.batch.job import PREDICTED, Job, computed
from paint_deposition.batch.sweep_file import DRAW, read_sweep
from paint_deposition.errors import BatchError
from paint_deposition.files.atomic import write_json, write_parquet
from paint_deposition.files.provenance import origin
from paint_deposition.report.colour_scales import ACCENT, INK
from paint_deposition.report.drawing import new_figure, quiet, save_picture
from paint_deposition.report.write import written

if TYPE_CHECKING:
    import pyarrow as pa
    from distributed import Client

# Shown for a case that leaves a value, or all of them, as in the sweep's file.
UNCHANGED = 'unchanged'
# By which cases are ranked, less being better; and all figures that are told, with their labels.
SCORE = 'sigma_n'
FIGURES = {SCORE: 'unevenness σ_N', 'mean_um': 'mean film [µm]'}


def sweep(
    path: str | Path,
    folder: str | Path,
    executor: Executor | Client | None = None,
    *,
    scheduler: str | None = None,
    count: int | None = None,
    progress: Callable[..., None] = lambda what, share=None: None,
) -> Sweep:
    """Compute the variations that a sweep file describes; each film is that of a single run.

    Args:
        path: of the YAML file.
        folder: what is finished is kept in its folder ``finished``: a run that was cut off
            computes the rest only.
        executor: what computes the cases: any of ``concurrent.futures``, or a Client of Dask,
            which sends the part once to each worker. Default: processes of this machine, or the
            workers of a scheduler.
        scheduler: of Dask, its address, 'tcp://10.0.0.5:8786'; default: DASK_SCHEDULER_ADDRESS,
            unless there is a count.
        count: of processes on this machine; default: one a core.
        progress: called with what is being done, and the share of it that is done.

    Raises:
        PaintError: a file that cannot be used, values that do not go together, or no case has a
            result.
    """
    if find_spec('pyarrow') is None:
        raise BatchError('a sweep needs pyarrow, which is not installed; run: pip install pyarrow')
    import pyarrow as pa

    path = Path(path)
    progress('reading')
    job = Job.of(read_sweep(path), path.parent, progress)
    open_executor = nullcontext(executor) if executor else workers(scheduler, count)
    figures, now = compute(
        computed, job.cases, job.inputs, Path(folder) / 'finished', open_executor, progress
    )
    columns: dict[str, Any] = {'case': pa.array(range(1, len(job.cases) + 1))}
    for name in job.varied:
        column = [values.get(name) for values in job.values]
        if any(isinstance(value, list) for value in column):  # numbers and texts as they are
            column = [None if value is None else json.dumps(value) for value in column]
        real = any(isinstance(value, float) for value in column)
        columns[name] = pa.array(column, pa.float64() if real else None)
    columns |= {name: figures[name] for name in figures.column_names}
    if 'error' not in columns:
        columns['error'] = pa.nulls(len(job.cases), pa.string())
    found = Sweep(job, pa.table(columns), now)
    if len(errors := found.texts('error')) == len(job.cases):
        number, error = errors[0]
        raise BatchError(f'none of {len(job.cases)} cases has a result; case {number}: {error}')
    return found


@dataclass(frozen=True)
class Sweep:
    """The finished cases of a sweep."""

    job: Job  # what was swept
    table: pa.Table  # a row for each case in the order of the job: what varied, then its figures
    computed: int  # how many cases this run computed; the others had been finished before

    def __repr__(self) -> str:
        return f'Sweep({self.sentence})'

    def column(self, name: str) -> np.ndarray:
        """(n,) numbers of the cases; NaN where a case has none."""
        values = self.table[name].to_pylist()
        return np.array([np.nan if value is None else value for value in values], dtype=float)

    def _spread(self, name: str) -> list[float]:
        return np.nanquantile(self.column(name), (0.05, 0.5, 0.95)).tolist()

    def texts(self, name: str) -> list[tuple[int, str]]:
        """Number of each case without a result, and why, by 'error'; or with 'warnings'."""
        texts = enumerate(self.table[name].to_pylist(), start=1)
        return [(number, text) for number, text in texts if text]

    @property
    def best(self) -> int | None:
        """Row of the most even film."""
        score = self.column(SCORE)
        return None if np.isnan(score).all() else int(np.nanargmin(score))

    @property
    def sentence(self) -> str:
        """The sweep in a line."""
        count, failed = len(self.job.cases), len(self.texts('error'))
        text = f'{count} cases, {self.computed} computed now, {count - self.computed} before'
        return f'{text}, {failed} without a result' if failed else text

    @property
    def lines(self) -> Iterator[str]:
        """The result in lines."""
        yield self.sentence
        for name, label in FIGURES.items():
            low, middle, high = self._spread(name)
            yield f'{label}: {middle:.4g}, 90 % of the cases {low:.4g} to {high:.4g}'
        if self.best is not None:
            values = self.job.values[self.best].items()
            texts = [f'{n} {f"{v:.6g}" if isinstance(v, float) else v}' for n, v in values]
            shown = ', '.join(texts) or UNCHANGED
            yield f'best by {FIGURES[SCORE]}: case {self.best + 1}, {shown}'

    def to_dict(self) -> dict[str, Any]:
        """The content of ``sweep.json``."""
        best = self.best
        return {
            'cases': len(self.job.cases),
            'computed': self.computed,
            'varied': self.job.varied,
            'figures': {
                name: dict(zip(('low_5', 'median', 'high_95'), self._spread(name), strict=True))
                for name in FIGURES
            },
            'judged_by': SCORE if best is not None else None,
            'best': None if best is None else {'case': best + 1, 'values': self.job.values[best]},
            'errors': [{'case': number, 'error': error} for number, error in self.texts('error')],
            'notes': list(self.job.notes),
            'provenance': origin(files=self.job.files),
        }


@written.register
def _write(sweep: Sweep, folder: Path, pictures: str = 'png') -> list[Path]:
    """Tables, figures and the picture."""
    names = sweep.table.column_names
    lists = [PREDICTED] if PREDICTED in names else []
    files = [write_parquet(folder / 'cases.parquet', sweep.table.drop_columns(lists))]
    if lists:
        files.append(write_parquet(folder / 'points.parquet', _points(sweep)))
    files.append(folder / 'sweep.json')
    write_json(files[-1], sweep.to_dict())
    over = {name: _axis_values(sweep, name) for name in sweep.job.varied if name != 'part_pose'}
    if over:
        results = {label: sweep.column(name) for name, label in FIGURES.items()}
        picture = folder / f'sweep.{pictures}'
        files.append(_write_picture(picture, over, results, sweep.sentence))
    return files


def _points(sweep: Sweep) -> pa.Table:
    """A row for each case and reading, with where it lies."""
    import pyarrow as pa

    rows = []
    for number, predicted in enumerate(sweep.table[PREDICTED].to_pylist(), start=1):
        *_, (*_, places) = sweep.job.cases[number - 1]
        readings = sweep.job.inputs[places]
        for k, value in enumerate(predicted or ()):
            place = dict(zip(('x_m', 'y_m', 'z_m'), readings.positions_m[k].tolist(), strict=True))
            point = str(readings.point[k])
            rows.append({'case': number, 'point': point, **place, PREDICTED: value})
    return pa.Table.from_pylist(rows)


def _axis_values(sweep: Sweep, name: str) -> np.ndarray:
    """(n,) numbers that varied, or texts: what files are called, which effects act."""
    default = getattr(sweep.job.file, name, None)
    given = [values.get(name, default) for values in sweep.job.values]
    if all(isinstance(value, int | float) for value in given if value is not None):
        return sweep.column(name)
    words = [
        '\n'.join(value) or 'none'
        if isinstance(value, list)
        else (value or UNCHANGED).replace('/', '/\n')
        for value in given
    ]
    return np.array(words)


def _write_picture(
    path: Path, varied: Mapping[str, np.ndarray], results: Mapping[str, np.ndarray], title: str
) -> Path:
    """Draw each result (n,), a row of charts, over each number or text that varied, a column."""
    names = list(varied)[:6]  # that fit side by side
    figure = new_figure(max(5.5, 3.4 * len(names)), 2.9 * len(results) + 0.4)
    charts = figure.subplots(len(results), len(names), squeeze=False, sharex='col', sharey='row')
    for axes, name in zip(charts[-1], names, strict=True):
        axes.set_xlabel(name)
    for row, (label, result) in zip(charts, results.items(), strict=True):
        for axes, name in zip(row, names, strict=True):
            quiet(axes, axes.get_xlabel(), label if axes is row[0] else '')
            is_text = varied[name].dtype.kind == 'U'
            there = np.isfinite(result) & (True if is_text else np.isfinite(varied[name]))
            if not there.any():
                continue
            values, shown = varied[name][there], result[there]
            axes.scatter(values, shown, s=14, color=ACCENT, alpha=0.55, linewidths=0)
            places = np.unique(values)
            # A line through the medians of few values.
            few = not is_text and 1 < len(places) <= 12 and len(values) > len(places)
            if few and name != DRAW:
                medians = [np.median(shown[values == place]) for place in places]
                axes.plot(places, medians, color=ACCENT, linewidth=1.4)
            # Rounding alone is no result: the chart does not magnify it.
            middle, span = np.median(shown), 0.01 * np.abs(np.median(shown))
            if np.ptp(shown) < span:
                axes.set_ylim(middle - span, middle + span)
    figure.suptitle(title, x=0.01, ha='left', fontsize=11, color=INK)
    return save_picture(figure, path)
