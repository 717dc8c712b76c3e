"""The command `sweep`: many variations of one job."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import click

from paint_deposition.cli.options import (
    FILE,
    JSON,
    PICTURES,
    file_lines,
    output_option,
    say_all,
)
from paint_deposition.cli.progress import Progress
from paint_deposition.cli.results_folder import results_in
from paint_deposition.errors import ManyError

SCHEDULER = click.option(
    '--scheduler',
    metavar='ADDRESS',
    help='Of a Dask scheduler with workers, tcp://10.0.0.5:8786; default: processes of this '
    'machine.',
)
WORKERS = click.option(
    '--workers', 'count', type=click.IntRange(min=1),
    help='Processes on this machine, of one thread each; default: one a core.',
)  # fmt: skip

MOST_WARNINGS = 5


def say_warnings(told: Iterable[tuple[str, str]], file: Path) -> None:
    """Print some of many warnings on stderr, each reason once, and where the others are.

    Args:
        told: name of a case or part, and what is odd about it.
        file: that has them all.
    """
    named: dict[str, list[str]] = {}
    for name, reason in told:
        named.setdefault(reason, []).append(name)
    lines = [
        f'{first}{f" and {len(others)} more" if others else ""}: {reason}'
        for reason, (first, *others) in named.items()
    ]
    say_all('warning', lines[:MOST_WARNINGS])
    if len(lines) > MOST_WARNINGS:
        say_all('warning', [f'{len(lines) - MOST_WARNINGS} more in {file}'])


@click.command('sweep')
@click.argument('sweep', type=FILE)
@output_option('cases.parquet, sweep.json and sweep.png')
@SCHEDULER
@WORKERS
@PICTURES
@JSON
def sweep_command(
    sweep: Path,
    output: Path,
    scheduler: str | None,
    count: int | None,
    pictures: str,
    as_json: bool,
) -> None:
    """Compute the variations that SWEEP, a YAML file, tells of.

    Each case is what `simulate` computes, or `compare` for a campaign. Finished cases are kept in
    the folder `finished` of the output: a run that was cut off computes the rest only, and so does
    a sweep with more cases.
    """
    from paint_deposition.files.parquet import MANY, require_libraries

    require_libraries('paint sweep', MANY)
    from paint_deposition.batch.cases import FOLDER, ResultCache
    from paint_deposition.batch.cluster import compute, require_alone
    from paint_deposition.batch.sweep.case import computed
    from paint_deposition.batch.sweep.job import Job
    from paint_deposition.batch.sweep.result import Sweep, write_sweep
    from paint_deposition.batch.sweep.sweep_file import read_sweep

    require_alone(scheduler, count)
    with Progress('sweep') as tell:
        tell('reading')
        job = Job.of(read_sweep(sweep), sweep.parent, tell)
        finished = ResultCache(output / FOLDER)
        say_all('note', job.notes)
        done, told = compute(scheduler, count, computed, job.cases, job.inputs, finished, tell)
        told = told or 'none: every case had been finished'
        say_all('note', [f'workers: {told}'])
        tell('writing and drawing')
        found = Sweep.of(job, finished, done, told)
        if len(found.errors) == len(job.cases):
            number, error = found.errors[0]
            raise ManyError(f'none of {len(job.cases)} cases has a result; case {number}: {error}')
        with results_in(output) as folder:
            files = [output / file.name for file in write_sweep(found, folder, pictures)]
    odd = ((f'case {number}', line) for number, line in (*found.errors, *found.warnings))
    say_warnings(odd, output / 'cases.parquet')
    if as_json:
        click.echo((output / 'sweep.json').read_text(encoding='utf-8'), nl=False)
        return
    for line in (*found.lines, *file_lines(files)):
        click.echo(line)
