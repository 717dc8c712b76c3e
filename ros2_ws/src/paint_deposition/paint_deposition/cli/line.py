"""The command `line`: many parts over days, and what changes."""

from __future__ import annotations

from pathlib import Path

import click

from paint_deposition.cli.options import (
    FOLDER,
    JSON,
    PICTURES,
    file_lines,
    output_option,
    say_all,
)
from paint_deposition.cli.progress import Progress
from paint_deposition.cli.results_folder import results_in
from paint_deposition.cli.sweep import MOST_WARNINGS, SCHEDULER, WORKERS, say_warnings
from paint_deposition.errors import ManyError


@click.command('line')
@click.argument('folder', type=FOLDER)
@output_option('points.parquet, parts.parquet, line.json, line.png and report.html')
@SCHEDULER
@WORKERS
@PICTURES
@JSON
def line_command(
    folder: Path,
    output: Path,
    scheduler: str | None,
    count: int | None,
    pictures: str,
    as_json: bool,
) -> None:
    """Simulate and compare all runs in FOLDER, and show what they share and what changes.

    FOLDER holds line.yaml, which names mesh and model, the recordings, and the readings of those
    parts that were measured, under the names of their recordings. Finished runs are kept in the
    folder `finished` of the output: the next time only new runs are computed.
    """
    from paint_deposition.files.parquet import MANY, require_libraries

    require_libraries('paint line', MANY)
    from paint_deposition.batch.cases import FOLDER, ResultCache
    from paint_deposition.batch.cluster import compute, require_alone
    from paint_deposition.batch.line.output import write_line
    from paint_deposition.batch.line.part import computed
    from paint_deposition.batch.line.result import Line
    from paint_deposition.batch.line.runs import line_cases, shared_files

    require_alone(scheduler, count)
    with Progress('line') as tell:
        tell('reading')
        cases, file, model, strays = line_cases(folder)
        finished, digests = ResultCache(output / FOLDER), [case.digest for case in cases]
        done, told = compute(scheduler, count, computed, cases, {}, finished, tell)
        told = told or 'none: every run had been finished'
        say_all('note', [f'workers: {told}'])
        tell('pooling')
        table = finished.table(digests)
        found = Line(folder, model, shared_files(folder, file), table, done, told, strays)
        if not found.runs:
            name, error = found.errors[0]
            raise ManyError(f'none of {len(cases)} runs can be used; {name}: {error}')
        with results_in(output) as results:
            files = [output / file.name for file in write_line(found, results, pictures)]
    say_warnings([*found.errors, *found.remarks], output / 'line.json')
    if strays:
        more = f' and {len(strays) - MOST_WARNINGS} more' if len(strays) > MOST_WARNINGS else ''
        named = ', '.join(strays[:MOST_WARNINGS])
        say_all('warning', [f'no recording has the name of {named}{more}; left out'])
    if as_json:
        click.echo((output / 'line.json').read_text(encoding='utf-8'), nl=False)
        return
    for line in (*found.lines, *file_lines(files)):
        click.echo(line)
