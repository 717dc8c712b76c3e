"""The commands `place` and `locate`: where a part may stand for a robot, and where it stands."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import paint_deposition as pd
from paint_deposition.cli import options
from paint_deposition.cli.results_folder import Progress

if TYPE_CHECKING:
    from paint_deposition.planning.driving import PartPlaces


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


@click.command('locate')
@click.option(
    '--touched', required=True, type=options.FILE,
    help='Points of the part that the robot touched, in its frame: CSV with point, x, y, z.',
)  # fmt: skip
@click.option(
    '--points', required=True, type=options.FILE,
    help='The same points in the frame of the part, by the same names.',
)  # fmt: skip
@click.option(
    '--pose-unit', type=click.Choice(['m', 'mm', 'cm']),
    help='Unit of points whose headings have none.',
)  # fmt: skip
@options.JSON
def locate_command(touched: Path, points: Path, pose_unit: str | None, as_json: bool) -> None:
    """Find the pose of a part in the frame of the robot, to be given as --part-pose.

    From three or more named points that the robot touched.
    """
    from paint_deposition.api.robot import locate_by_points
    from paint_deposition.files.atomic import json_text
    from paint_deposition.files.provenance import origin

    place = locate_by_points(touched, points, pose_unit)
    options.print_all('warning', place.warnings)
    if as_json:
        files = {'touched': touched, 'points': points}
        click.echo(json_text(place.to_dict() | {'provenance': origin(files=files)}))
        return
    values = [f'{value + 0.0:.6g}' for value in place.pose.values]
    click.echo(f'--part-pose {" ".join(values)}')
    click.echo(f'part_pose: [{", ".join(values)}]')
    click.echo(f'residual {place.rms_m * 1e3:.2f} mm RMS')
    for name, residual_m in place.residuals_m.items():
        click.echo(f'  {name}: {residual_m * 1e3:.2f} mm')
