"""Commands that lay out passes: `recommend`, `plan`, `improve`, and `place` the part for them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

import paint_deposition as pd
from paint_deposition.cli import options
from paint_deposition.cli.models import chosen_model, model_for, robot_cell
from paint_deposition.cli.options import Part, options_of
from paint_deposition.cli.results import Results, inputs, progress, results_options, zone_lines
from paint_deposition.planning.requests import (
    GunEnvelope,
    ImproveRequest,
    IndexRequest,
    PlanRequest,
)
from paint_deposition.request import MotionOptions

PAINT_MOVES = click.option(
    '--paint-moves', is_flag=True,
    help='Spray by PaintL with SetBrush in passes.mod; default: by MoveL, with an output.',
)  # fmt: skip


@click.command('recommend')
@options.model_option()
@options.BRUSH
@options_of(IndexRequest)
@results_options('recommendation.json and uniformity.png', 'recommendation')
def recommend_command(
    request: IndexRequest, model_file: Path | None, brush: int, results: Results
) -> None:
    """Recommend the index between passes for an even film, at --speed or for --target-um."""
    file, of_model = chosen_model(model_file, brush=brush)
    answer = pd.recommend(file.model, **dict(request))
    results.write(answer, model=file.model, made_from=inputs(model_file=model_file))
    lines = [answer.sentence, f'SB50 of one pass: {1e3 * answer.sb50_m:.0f} mm']
    lines += (
        f'minimum: sigma_n {100 * sigma_n:.2f} % at {1e3 * index_m:.0f} mm'
        for index_m, sigma_n in answer.curve.minima
    )
    lines += (
        f'within tolerance: {1e3 * low:.0f} to {1e3 * high:.0f} mm'
        for low, high in answer.windows_m
    )
    if answer.index_drift_m and answer.standoff_drift_m:
        index, standoff = answer.index_drift_m, answer.standoff_drift_m
        lines.append(
            f'permitted drift: index from {1e3 * index[0]:.0f} to {1e3 * index[1]:.0f} mm, '
            f'standoff by {standoff[0] * 1e3:+.0f} to {standoff[1] * 1e3:+.0f} mm'
        )
    lines += (f'note: {note}' for note in answer.notes)
    results.print(lines, of_model)


@click.command('plan')
@options.part_options(0.02, zones=True)
@options.model_option()
@options.BRUSH
@options_of(PlanRequest)
@options.PART_POSE
@options.robot_options
@options.option_of(
    MotionOptions, 'frame_id',
    help='Frame of the poses that are written; default: part, or base_link with --part-pose.',
)  # fmt: skip
@click.option(
    '--faces', type=click.Choice(['one', 'auto']), default='one', show_default=True,
    help='auto: split the part into faces that can be sprayed from one side each, as a hood '
    'with its flange or a bumper, and blend their seams.',
)  # fmt: skip
@click.option(
    '--face-angle-deg', show_default='40', type=options.FiniteRange(5.0, 75.0),
    help='With --faces auto: largest angle between a normal of a face and their mean.',
)  # fmt: skip
@options_of(GunEnvelope, into='envelope')
@PAINT_MOVES
@results_options('the bag, passes.csv, passes.mod, plan.json and the film')
def plan_command(
    request: PlanRequest,
    envelope: GunEnvelope,
    part: Part,
    robot: dict[str, Any],
    model_file: Path | None,
    brush: int,
    part_pose: list[float] | None,
    frame_id: str | None,
    faces: str,
    face_angle_deg: float | None,
    paint_moves: bool,
    results: Results,
) -> None:
    """Lay passes over a part: where they lie, how the gun moves, and the film to expect.

    With --part-pose the files have their poses in the frame of the robot, base_link by default.
    """
    file, of_model = chosen_model(model_file, brush=brush)
    cell = robot_cell(robot, part_pose)
    frame_id = frame_id or ('part' if part_pose is None else 'base_link')
    if faces == 'one' and face_angle_deg is not None:
        raise click.UsageError('--face-angle-deg is for faces; give --faces auto')
    usual = PlanRequest.model_fields
    for name in ('paint_weight', 'time_weight'):
        given_it = getattr(request, name) != usual[name].default
        if given_it and not (request.optimise or part.zones_file):
            option = name.replace('_', '-')
            raise click.UsageError(f'--{option} is for --optimise; give that too, or leave it out')
    with progress('plan') as show:
        show('reading the mesh')
        surface = part.surface()
        given: dict[str, Any] = {
            'frame_id': frame_id if part_pose is None else 'part', 'envelope': envelope,
            'robot': cell, 'progress': show, 'zones': part.zones(), **dict(request),
        }  # fmt: skip
        result: pd.Plan | pd.PartPlan
        if faces == 'one':
            result = pd.plan(surface, file.model, **given)
        else:
            if face_angle_deg is not None:
                given['face_angle_deg'] = face_angle_deg
            result = pd.plan_faces(surface, file.model, **given)
        show('writing')
        made_from = {
            **inputs(mesh_file=part.mesh, model_file=model_file, zones_file=part.zones_file),
            'frame_id': frame_id, 'part_pose': part_pose,
        }  # fmt: skip
        results.write(
            result, made_from=made_from, part_pose=part_pose, frame_id=frame_id,
            paint_moves=paint_moves,
        )  # fmt: skip
    results.print(_plan_lines(result), of_model, surface.notes, result.warnings)


def _plan_lines(result: pd.Plan | pd.PartPlan) -> Iterator[str]:
    from paint_deposition.film.statistics import paint_sentence

    film, whole, gun = result.statistics, result.whole_part, result.envelope
    first = result.unoptimised if isinstance(result, pd.Plan) else None
    yield result.sentence
    yield (
        f'film there {film.min_um:.1f} to {film.max_um:.1f} µm; on the whole part '
        f'{whole.min_um:.1f} to {whole.max_um:.1f} µm, mean {whole.mean_um:.1f} µm, coverage '
        f'{100 * whole.coverage:.0f} %, capture fraction '
        f'{100 * whole.capture_fraction:.0f} %'
    )
    yield from zone_lines(film.zones, first.statistics.zones if first else {})
    yield from filter(
        None,
        [paint_sentence(result.paint, result.statistics), result.drive and result.drive.sentence],
    )
    if not result.contacts:
        yield (
            f'gun ({2e3 * gun.radius_m:.0f} mm wide, {1e3 * gun.length_m:.0f} mm long) and the '
            f'{1e3 * gun.before_m:.0f} mm before it keep clear of the part'
        )
    if first:
        paint = first.statistics
        more = 100.0 * (paint.emitted_volume_cm3 / film.emitted_volume_cm3 - 1.0)
        yield (
            f'without --optimise: {first.sentence}; paint sprayed {more:+.0f} %, '
            f'capture fraction {100 * paint.capture_fraction:.0f} %'
        )


@click.command('improve')
@options.part_options(0.02, zones=True)
@click.option(
    '--trajectory', required=True, type=options.FILE,
    help='The programme: a bag, a table of poses, or a RAPID module, taken as programmed.',
)  # fmt: skip
@options.model_option()
@options_of(ImproveRequest)
@options.seed_option('the models drawn from the posterior of the model file')
@options.motion_options
@PAINT_MOVES
@options.JOINT_ACCELERATION
@options.ALLOW_EFFECTS
@results_options('the bag, passes.csv, passes.mod, improvement.json, the picture and the film')
def improve_command(
    request: ImproveRequest,
    part: Part,
    trajectory: Path,
    model_file: Path | None,
    paint_moves: bool,
    seed: int,
    motion: dict[str, Any],
    joint_acceleration: float | None,
    results: Results,
) -> pd.Improvement:
    """Make the film of a given programme more even; its path stays as it is.

    Speeds along the passes, flows and the places where the gun opens and closes are chosen
    through the whole model. What changes is printed pass by pass. With --urdf and --part-pose no
    joint of the robot is faster than it can be.
    """
    from paint_deposition.files.motion_files import holds_joints

    with progress('improve') as show:
        show('reading')
        (file, of_model), part_pose = model_for(model_file, trajectory), motion['part_pose']
        robot = {name: motion[name] for name in options.ROBOT}
        limits = {'joint_acceleration': joint_acceleration}
        joints = holds_joints(trajectory)
        # Of recorded joints the URDF may be meant for reading them only.
        drives = part_pose or joint_acceleration or not joints
        cell = robot_cell(robot | limits, part_pose) if drives else None
        known = motion if joints else motion | dict.fromkeys(robot)
        recorded = pd.read_recording(trajectory, **known)
        show('refining the mesh')
        result = pd.improve(
            part.surface(), recorded, file.model, posterior=file.posterior, robot=cell,
            zones=part.zones(), seed=seed, progress=show, **dict(request),
        )  # fmt: skip
        made_from = {
            **inputs(mesh_file=part.mesh, trajectory=trajectory, model_file=file.path,
                     zones_file=part.zones_file),
            'part_pose': part_pose,
        }  # fmt: skip
        show('writing and drawing')
        results.write(
            result, made_from=made_from, part_pose=part_pose,
            frame_id=recorded.read_in or 'base_link', paint_moves=paint_moves,
        )  # fmt: skip
    notes = (*result.surface.notes, *recorded.notes, *result.notes)
    results.print(_improvement_lines(result), of_model, notes, result.warnings)
    return result


def _improvement_lines(result: pd.Improvement) -> Iterator[str]:
    before, after = result.before, result.after
    yield f'{result.region}:'
    yield result.sentence
    films = {'there': (before.statistics, after.statistics)}
    if not result.wanted.region.all():
        films['on the whole part'] = before.whole_part, after.whole_part
    for where, (a, b) in films.items():
        yield (
            f'film {where}: mean {a.mean_um:.1f} → {b.mean_um:.1f} µm; {a.min_um:.1f} to '
            f'{a.max_um:.1f} µm before, {b.min_um:.1f} to {b.max_um:.1f} µm after'
        )
    yield from zone_lines(after.statistics.zones, before.statistics.zones)
    for change in result.changes:
        yield change.sentence
    yield from result.limit_sentences
    if result.drive:
        yield result.drive.sentence
    yield (
        'the robot program lays the film of the bag within '
        f'{100 * result.program_difference:.2f} % of its peak'
    )


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

    from paint_deposition.planning.part_places import part_places

    cell = robot_cell(robot, part_pose)
    if cell is None or part_pose is None:
        raise click.UsageError('give the robot as --urdf, and --part-pose')
    spans = [
        span or (about - 0.6, about + 0.6)
        for span, about in zip((x_m, y_m), part_pose[:2], strict=True)
    ]
    x, y = (low + step_m * np.arange(int((high - low) / step_m + 1e-6) + 1) for low, high in spans)
    with progress('place') as show:
        show('reading')
        recorded = pd.read_recording(trajectory)
        found = part_places(recorded, cell, x, y, free_roll, show)
        results.write(found, made_from=inputs(trajectory=trajectory, urdf=robot['urdf']))
    lines = [found.sentence]
    if found.speed.max() > 0.0:
        lines.append('--part-pose ' + ' '.join(f'{value + 0.0:.6g}' for value in found.part_pose))
    results.print(lines, notes=recorded.notes)
