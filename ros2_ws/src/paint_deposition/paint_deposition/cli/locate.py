"""The command `locate`: where a part stands in the frame of the robot."""

from __future__ import annotations

from pathlib import Path

import click

from paint_deposition.cli.options import FILE, JSON, say_all


@click.command('locate')
@click.option(
    '--touched', type=FILE, required=True,
    help='Points of the part that the robot touched, in its frame: CSV with point, x, y, z.',
)  # fmt: skip
@click.option(
    '--points', type=FILE, required=True,
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
    say_all('warning', place.warnings)
    if as_json:
        made_from = origin(files={'touched': touched, 'points': points})
        click.echo(json_text(place.to_dict() | {'provenance': made_from}))
        return
    values = [f'{value + 0.0:.6g}' for value in place.pose.values]
    click.echo(f'--part-pose {" ".join(values)}')
    click.echo(f'part_pose: [{", ".join(values)}]')
    click.echo(f'residual {place.rms_m * 1e3:.2f} mm RMS')
    for name, residual_m in place.residuals_m.items():
        click.echo(f'  {name}: {residual_m * 1e3:.2f} mm')
