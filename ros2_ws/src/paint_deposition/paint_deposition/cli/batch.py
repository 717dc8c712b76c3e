"""The command `sweep`: many variations of one job."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import click

from paint_deposition.cli import options
from paint_deposition.cli.progress import Progress

MOST_WARNINGS = 5


@click.command('sweep')
@click.argument('sweep', type=options.FILE)
@click.option(
    '--scheduler', metavar='ADDRESS',
    help='Address of a Dask scheduler, tcp://10.0.0.5:8786; default: DASK_SCHEDULER_ADDRESS, else '
    'processes of this machine.',
)  # fmt: skip
@click.option(
    '--workers', 'count', type=click.IntRange(min=1),
    help='Processes on this machine, of one thread each; default: one a core.',
)  # fmt: skip
@options.ALLOW_EFFECTS
@options.results_options('cases.parquet, sweep.json and sweep.png')
def sweep_command(
    sweep: Path, results: options.Results, scheduler: str | None, count: int | None
) -> None:
    """Compute the variations that SWEEP, a YAML file, describes.

    Each case is what `simulate` computes. Finished cases are kept in the folder `finished` of the
    output: a run that was cut off computes the rest only, and so does a sweep with more cases.
    """
    if scheduler and count:
        raise click.UsageError('--workers is for this machine; leave it out beside --scheduler')
    from paint_deposition.batch.sweep import sweep as computed

    with Progress('sweep') as show:
        found = computed(sweep, results.output, scheduler=scheduler, count=count, progress=show)
        show('writing and drawing')
        results.write(found)
    options.print_all('note', found.job.notes)
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
