"""The commands `sweep`, many variations of one job, and `line`, many parts over days."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import click

from paint_deposition.cli import options
from paint_deposition.cli.progress import Progress
from paint_deposition.errors import ManyError
from paint_deposition.files.parquet import MANY, require_libraries

MOST_WARNINGS = 5
workers_option = click.option(
    '--workers', 'count', type=click.IntRange(min=1),
    help='Processes of one thread each, side by side; default: one a core.',
)  # fmt: skip


@click.command('sweep')
@click.argument('sweep', type=options.FILE)
@workers_option
@options.ALLOW_EFFECTS
@options.results_options('cases.parquet, sweep.json and sweep.png')
def sweep_command(sweep: Path, results: options.Results, count: int | None) -> None:
    """Compute the variations that SWEEP, a YAML file, describes.

    Each case is what `simulate` computes. Finished cases are kept in the folder `finished` of the
    output: a run that was cut off computes the rest only, and so does a sweep with more cases.
    """
    require_libraries('paint sweep', MANY)
    from paint_deposition.batch.cases import ResultCache
    from paint_deposition.batch.processes import compute
    from paint_deposition.batch.sweep.case import computed
    from paint_deposition.batch.sweep.job import Job
    from paint_deposition.batch.sweep.result import Sweep
    from paint_deposition.batch.sweep.sweep_file import read_sweep

    with Progress('sweep') as show:
        show('reading')
        job = Job.of(read_sweep(sweep), sweep.parent, show)
        options.print_all('note', job.notes)
        finished = ResultCache(results.output / 'finished')
        done = compute(computed, job.cases, job.inputs, finished, show, count)
        show('writing and drawing')
        found = Sweep.of(job, finished, done)
        if len(found.errors) == len(job.cases):
            number, error = found.errors[0]
            raise ManyError(f'none of {len(job.cases)} cases has a result; case {number}: {error}')
        results.write(found)
    odd = ((f'case {number}', line) for number, line in (*found.errors, *found.warnings))
    _print_warnings(odd, results.output / 'cases.parquet')
    results.print(found.lines)


@click.command('line')
@click.argument('folder', type=options.FOLDER)
@workers_option
@options.ALLOW_EFFECTS
@options.results_options('points.parquet, parts.parquet, line.json and line.png')
def line_command(folder: Path, results: options.Results, count: int | None) -> None:
    """Simulate and compare all runs in FOLDER, and show what they share and what changes.

    FOLDER holds line.yaml, which names mesh and model, the recordings, and the readings of those
    parts that were measured, under the names of their recordings. Finished runs are kept in the
    folder `finished` of the output: the next time only new runs are computed.
    """
    require_libraries('paint line', MANY)
    from paint_deposition.batch.cases import ResultCache
    from paint_deposition.batch.line.part import computed
    from paint_deposition.batch.line.result import Line
    from paint_deposition.batch.line.runs import line_cases, shared_files
    from paint_deposition.batch.line.times import dated
    from paint_deposition.batch.processes import compute

    with Progress('line') as show:
        show('reading')
        cases, file, model, unmatched = line_cases(folder)
        finished = ResultCache(results.output / 'finished')
        done = compute(computed, cases, {}, finished, show, count)
        show('pooling')
        table = dated(finished.table(case.digest for case in cases))
        found = Line(model, shared_files(folder, file), table, done, unmatched)
        if not found.runs:
            name, error = found.errors[0]
            raise ManyError(f'none of {len(cases)} runs can be used; {name}: {error}')
        results.write(found)
    _print_warnings([*found.errors, *found.remarks], results.output / 'line.json')
    options.print_all('warning', found.warnings)
    results.print(found.lines)


def _print_warnings(warnings: Iterable[tuple[str, str]], file: Path) -> None:
    """Print some of many warnings (name, reason), each reason once, and the file of all."""
    named: dict[str, list[str]] = {}
    for name, reason in warnings:
        named.setdefault(reason, []).append(name)
    lines = [
        f'{first}{f" and {len(others)} more" if others else ""}: {reason}'
        for reason, (first, *others) in named.items()
    ]
    options.print_all('warning', lines[:MOST_WARNINGS])
    if len(lines) > MOST_WARNINGS:
        options.print_all('warning', [f'{len(lines) - MOST_WARNINGS} more in {file}'])
