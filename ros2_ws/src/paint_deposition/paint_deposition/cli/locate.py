"""The command `locate`: where a part stands in the frame of the robot."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from paint_deposition.cli.options import FILE, JSON, print_all

if TYPE_CHECKING:
    from paint_deposition.motion.part_location import PartPlace


@click.command('locate')
@click.option(
    '--touched', required=True, type=FILE,
    help='Points of the part that the robot touched, in its frame: CSV with point, x, y, z.',
)  # fmt: skip
@click.option(
    '--points', required=True, type=FILE,
    help='The same points in the frame of the part, by the same names.',
)  # fmt: skip
@click.option(
    '--pose-unit', type=click.Choice(['m', 'mm', 'cm']),
    help='Unit of points whose headings have none.',
)  # fmt: skip
@JSON
def locate_command(touched: Path, points: Path, pose_unit: str | None, as_json: bool) -> None:
    """Find the pose of a part in the frame of the robot, to be given as --part-pose.

    From three or more named points that the robot touched.
    """
    from paint_deposition.api.locating import locate_by_points
    from paint_deposition.files.json_files import json_text
    from paint_deposition.files.provenance import origin

    place = locate_by_points(touched, points, pose_unit)
    print_all('warning', place.warnings)
    if as_json:
        files = {'touched': touched, 'points': points}
        click.echo(json_text(place.to_dict() | {'provenance': origin(files=files)}))
        return
    for line in _lines(place):
        click.echo(line)


def _lines(place: PartPlace) -> Iterator[str]:
    values = [f'{value + 0.0:.6g}' for value in place.pose.values]
    yield f'--part-pose {" ".join(values)}'
    yield f'part_pose: [{", ".join(values)}]'
    yield f'residual {place.rms_m * 1e3:.2f} mm RMS'
    for name, residual_m in place.residuals_m.items():
        yield f'  {name}: {residual_m * 1e3:.2f} mm'
