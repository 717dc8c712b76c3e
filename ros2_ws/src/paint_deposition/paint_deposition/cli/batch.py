"""The command `sweep`: many variations of one job."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import click

from paint_deposition.cli import options
from paint_deposition.cli.progress import Progress
from paint_deposition.errors import ManyError
from paint_deposition.files.parquet import require_pyarrow

MOST_WARNINGS = 5
workers_option = click.option(
    '--workers', 'count', type=click.IntRange(min=1),
    help='Processes of one thread each, side by side; default: one a core.',
)  # fmt: skip


@click.command('sweep')
@click.argument('sweep', type=options.FILE)
@workers_option
@options.results_options('cases.parquet, sweep.json and sweep.png')
def sweep_command(sweep: Path, results: options.Results, count: int | None) -> None:
    """Compute the variations that SWEEP, a YAML file, describes.

    Each case is what `simulate` computes. Finished cases are kept in the folder `finished` of the
    output: a run that was cut off computes the rest only, and so does a sweep with more cases.
    """
    require_pyarrow('paint sweep')
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
