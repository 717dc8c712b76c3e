"""Commands that tell where: `place` and `locate` the part before a robot, `measure` the gauge."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

import paint_deposition as pd
from paint_deposition.cli import options
from paint_deposition.cli.models import chosen_model, model_for, robot_cell
from paint_deposition.cli.options import Part, options_of
from paint_deposition.cli.results import Progress, Results, inputs, print_all, results_options
from paint_deposition.errors import RecordingError
from paint_deposition.planning.requests import FilmBuild, MeasureRequest
from paint_deposition.request import MotionOptions


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
@results_options('place.json, places.csv and the map')
def place_command(
    trajectory: Path,
    part_pose: list[float] | None,
    robot: dict[str, Any],
    x_m: tuple[float, float] | None,
    y_m: tuple[float, float] | None,
    step_m: float,
    free_roll: bool,
    results: Results,
) -> None:
    """Look where the part may stand so that the robot drives all passes.

    Height and turn of the part are those of --part-pose; x and y are tried on a grid.
    """
    import numpy as np

    from paint_deposition.api.planning import place

    cell = robot_cell(robot, part_pose)
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
        results.write(found, made_from=inputs(trajectory=trajectory, urdf=robot['urdf']))
    lines = [found.sentence]
    if found.speed.max() > 0.0:
        lines.append('--part-pose ' + ' '.join(f'{value + 0.0:.6g}' for value in found.part_pose))
    results.print(lines, notes=recorded.notes)


@click.command('locate')
@click.option(
    '--touched', required=True, type=options.FILE,
    help='Points of the part that the robot touched, in its frame: CSV with point, x, y, z.',
)  # fmt: skip
@click.option(
    '--points', required=True, type=options.FILE,
    help='The same points in the frame of the part, by the same names.',
)  # fmt: skip
@options.option_of(MotionOptions, 'pose_unit')
@options.JSON
def locate_command(touched: Path, points: Path, pose_unit: str | None, as_json: bool) -> None:
    """Find the pose of a part in the frame of the robot, to be given as --part-pose.

    From three or more named points that the robot touched.
    """
    from paint_deposition.files.atomic import json_text
    from paint_deposition.files.gauge_readings import read_points
    from paint_deposition.files.provenance import origin
    from paint_deposition.planning.part_places import locate

    given = read_points(touched, pose_unit), read_points(points, pose_unit)
    try:
        place = locate(*given)
    except RecordingError as error:
        raise RecordingError(f'{touched} and {points}: {error}') from None
    print_all('warning', place.warnings)
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


@click.command('measure')
@options.part_options(0.01)
@click.option(
    '--trajectory', type=options.FILE,
    help='The motion, as `simulate` takes it; default: passes as `plan` would lay them, '
    'with --target-um or --speed.',
)  # fmt: skip
@options.model_option()
@options.BRUSH
@options_of(MeasureRequest)
@options_of(FilmBuild, into='passes')
@options.motion_options
@options.MAX_POSE_GAP
@options.ALLOW_EFFECTS
@results_options('points.csv, poses.csv, points.png and measure.json')
def measure_command(
    request: MeasureRequest,
    passes: FilmBuild,
    part: Part,
    trajectory: Path | None,
    model_file: Path | None,
    brush: int,
    motion: dict[str, Any],
    max_pose_gap_s: float,
    results: Results,
) -> None:
    """Choose where to put the gauge on a part, so that missing effects are found soonest.

    Fill the column thickness_um of points.csv and give that file as the measurements of a
    campaign.
    """
    if trajectory is None and passes == FilmBuild():
        raise click.UsageError(
            'no motion is given; give --trajectory, or --target-um for passes '
            'as `plan` would lay them'
        )
    with Progress('measure') as show:
        show('reading')
        surface = part.surface()
        warnings: tuple[str, ...] = ()
        if trajectory is None:
            chosen = chosen_model(model_file, brush=brush)
            recorded = pd.plan(surface, chosen.model, progress=show, **dict(passes)).trajectory
        else:
            chosen = model_for(model_file, trajectory)
            recorded = pd.read_recording(trajectory, **motion)
            warnings = recorded.warnings
        result = pd.choose_readings(
            surface, recorded, chosen.model, posterior=chosen.posterior,
            max_pose_gap_s=max_pose_gap_s, progress=show, **dict(request),
        )  # fmt: skip
        made_from = inputs(mesh_file=part.mesh, trajectory=trajectory, model_file=chosen.path)
        show('writing and drawing')
        results.write(result, made_from=made_from, part_pose=motion['part_pose'])
    results.print(_point_lines(result), chosen.words, result.surface.notes, warnings)


def _point_lines(result: pd.ChosenReadings) -> Iterator[str]:
    yield result.sentence
    hidden = []
    for name, chance in sorted(result.power.items(), key=lambda pair: -pair[1]):
        if chance < 0.15:  # the part hardly shows it
            hidden.append(name)
            continue
        grid = result.grid_power[name]
        yield f'{name:>22} {100 * chance:3.0f} %   on a grid {100 * grid:3.0f} %'
    if hidden:
        yield f'unlikely to be detected on this part at their typical size: {", ".join(hidden)}'
    yield (
        f'at least {result.apart_m * 1e3:.0f} mm from each other and {result.foot_m * 1e3:.0f} mm '
        f'off edges; {result.repeats} of them are to be read twice'
    )
