"""The command `place`: where a part may stand so that a robot drives all passes over it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import paint_deposition as pd
from paint_deposition.cli import options
from paint_deposition.cli.progress import Progress

if TYPE_CHECKING:
    from paint_deposition.planning.part_place import PartPlaces


def _span(axis: str) -> Any:
    return click.option(
        f'--{axis}', f'{axis}_m', nargs=2, type=options.NUMBER, metavar='FROM TO',
        help=f'Range of {axis} to try [m]; default: 0.6 m to both sides of --part-pose.',
    )  # fmt: skip


@click.command('place')
@click.option(
    '--trajectory', required=True, type=options.FILE,
    help='The passes: a bag, a table of poses, or a RAPID module, in the frame of the part or, '
    'with another frame than "part", in that of the robot with the part at --part-pose.',
)  # fmt: skip
@options.PART_POSE
@options.robot_options
@_span('x')
@_span('y')
@click.option(
    '--step', 'step_m', default=0.2, show_default=True, type=options.POSITIVE,
    help='Between places [m].',
)  # fmt: skip
@click.option('--free-roll', is_flag=True, help='The tool may be turned about its own axis.')
@options.results_options('place.json, places.csv and the map')
def place_command(
    trajectory: Path,
    part_pose: list[float] | None,
    robot: dict[str, Any],
    x_m: tuple[float, float] | None,
    y_m: tuple[float, float] | None,
    step_m: float,
    free_roll: bool,
    results: options.Results,
) -> None:
    """Look where the part may stand so that the robot drives all passes.

    Height and turn of the part are those of --part-pose; x and y are tried on a grid.
    """
    import numpy as np

    from paint_deposition.api.robot import place

    cell = options.robot_cell(robot, part_pose)
    if cell is None or part_pose is None:
        raise click.UsageError('give the robot as --urdf, and --part-pose')
    spans = [
        span or (about - 0.6, about + 0.6)
        for span, about in zip((x_m, y_m), part_pose[:2], strict=True)
    ]
    x, y = (low + step_m * np.arange(int((high - low) / step_m + 1e-6) + 1) for low, high in spans)
    with Progress('place') as show:
        show('reading')
        recorded = pd.read_recording(trajectory)
        found = place(recorded, cell, x, y, free_roll, show)
        made_from = {'trajectory': str(trajectory), 'urdf': str(robot['urdf'])}
        results.write(found, made_from=made_from)
    options.print_all('note', recorded.notes)
    results.print(_lines(found))


def _lines(found: PartPlaces) -> Iterator[str]:
    yield found.sentence
    if found.speed.max() > 0.0:
        yield '--part-pose ' + ' '.join(f'{value + 0.0:.6g}' for value in found.part_pose)
