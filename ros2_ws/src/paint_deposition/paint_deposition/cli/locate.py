"""The command `locate`: where a part stands in the frame of the robot."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from paint_deposition.cli.options import (
    FILE,
    JSON,
    MESH_SCALE,
    POSITIVE,
    pose_option,
    say_all,
)
from paint_deposition.cli.progress import Progress

if TYPE_CHECKING:
    from paint_deposition.motion.part_location import PartPlace


@click.command('locate')
@click.option(
    '--touched', type=FILE,
    help='Points of the part that the robot touched, in its frame: CSV with point, x, y, z.',
)  # fmt: skip
@click.option(
    '--points', type=FILE, help='The same points in the frame of the part, by the same names.'
)
@click.option('--scan', type=FILE, help='Scan of the part in the frame of the robot, a mesh.')
@click.option('--mesh', type=FILE, help='The part, for --scan.')
@pose_option('--start', 'Pose of the part to begin with; default: found from the shapes.')
@click.option(
    '--pose-unit', type=click.Choice(['m', 'mm', 'cm']),
    help='Unit of points whose headings have none.',
)  # fmt: skip
@MESH_SCALE
@click.option('--scan-scale', default=1.0, show_default=True, type=POSITIVE,
              help='Metres per unit of the scan.')  # fmt: skip
@JSON
def locate_command(
    touched: Path | None,
    points: Path | None,
    scan: Path | None,
    mesh: Path | None,
    start: list[float] | None,
    pose_unit: str | None,
    mesh_scale: float,
    scan_scale: float,
    as_json: bool,
) -> None:
    """Find the pose of a part in the frame of the robot, to be given as --part-pose.

    Either from three or more named points that the robot touched (--touched and --points), or
    from a scan (--scan and --mesh).
    """
    from paint_deposition.api.locating import locate_by_points, locate_by_scan
    from paint_deposition.files.json_files import json_text
    from paint_deposition.files.provenance import origin

    if touched and points and not (scan or mesh or start):
        place = locate_by_points(touched, points, pose_unit)
    elif scan and mesh and not (touched or points):
        with Progress('locate') as show:
            show('fitting the scan to the part')
            place = locate_by_scan(scan, mesh, start, scan_scale, mesh_scale)
    else:
        raise click.UsageError('give --touched and --points, or --scan and --mesh')
    say_all('warning', place.warnings)
    if as_json:
        files = {'touched': touched, 'points': points, 'scan': scan, 'mesh': mesh}
        named = {what: file for what, file in files.items() if file}
        click.echo(json_text(place.to_dict() | {'provenance': origin(files=named)}))
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
