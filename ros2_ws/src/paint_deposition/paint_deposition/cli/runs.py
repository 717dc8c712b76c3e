"""The command `runs`: what a cell has painted, part by part."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from paint_deposition.cli.options import FOLDER, JSON
from paint_deposition.files.json_files import json_text
from paint_deposition.files.provenance import origin
from paint_deposition.files.recordings.cell_runs import CellRun, read_cell_runs

HEADINGS = (
    'run', 'type', 'coat', 'since', 'poses', 'gaps', 'mean µm', 'std µm', 'min', 'max',
    'coverage', 'in target', 'cm3', 'recording',
)  # fmt: skip
NOTHING = '-'


@click.command('runs')
@click.argument('folder', type=FOLDER)
@JSON
def runs_command(folder: Path, as_json: bool) -> None:
    """List the runs in FOLDER, the output_directory of the nodes: each coat on each part.

    Shown are the part, when it came, its poses, its film and whether the recording is complete.
    """
    runs = read_cell_runs(folder)
    if as_json:
        figures = {'folder': str(folder), 'runs': [asdict(run) for run in runs]}
        click.echo(json_text(figures | {'provenance': origin()}))
        return
    rows = [HEADINGS, *(_row(run) for run in runs)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        click.echo('  '.join(cells).rstrip())


def _row(run: CellRun) -> tuple[str, ...]:
    film = run.film
    within = film.get('within_target')
    return (
        run.run,
        run.type or NOTHING,
        str(run.coat),
        run.since[:19].replace('T', ' ') or NOTHING,
        NOTHING if run.poses is None else str(run.poses),
        NOTHING if run.gaps is None else str(run.gaps),
        *(_number(film.get(name)) for name in ('mean_um', 'std_dev_um', 'min_um', 'max_um')),
        _share(film.get('coverage')),
        _share(within),
        _number(film.get('painted_volume_cm3'), 2),
        run.recording,
    )


def _number(value: float | None, digits: int = 1) -> str:
    return NOTHING if value is None else f'{value:.{digits}f}'


def _share(value: float | None) -> str:
    return NOTHING if value is None else f'{value:.1%}'
