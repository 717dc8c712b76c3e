"""Commands that lay out passes: `recommend` and `plan`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

import paint_deposition as pd
from paint_deposition.cli import options
from paint_deposition.cli.model_choice import chosen_model
from paint_deposition.cli.options_of import options_of
from paint_deposition.cli.results_folder import Progress
from paint_deposition.planning.requests import GunEnvelope, IndexRequest, PlanRequest


@click.command('recommend')
@options.MODEL
@options.BRUSH
@options_of(IndexRequest)
@options.results_options(
    'recommendation.json and uniformity.png; default: the working directory', '.'
)
def recommend_command(
    request: IndexRequest, model_file: Path | None, brush: int, results: options.Results
) -> None:
    """Recommend the index between passes for an even film, at --speed or for --target-um."""
    chosen = chosen_model(model_file, brush=brush)
    answer = pd.recommend(chosen.model, **dict(request))
    made_from = {'model_file': str(model_file or '')}
    results.write(answer, model=chosen.model, made_from=made_from)
    results.print(_recommendation_lines(answer), model=chosen.words)


def _recommendation_lines(answer: pd.Recommendation) -> Iterator[str]:
    yield answer.sentence
    for minimum in answer.minima:
        yield f'minimum: sigma_n {100 * minimum.sigma_n:.2f} % at {1e3 * minimum.index_m:.0f} mm'
    for low, high in answer.windows_m:
        yield f'within tolerance: {1e3 * low:.0f} to {1e3 * high:.0f} mm'
    if answer.index_drift_m and answer.standoff_drift_m:
        index, standoff = answer.index_drift_m, answer.standoff_drift_m
        yield (
            f'the index may drift to {1e3 * index[0]:.0f} and {1e3 * index[1]:.0f} mm, the '
            f'standoff by {standoff[0] * 1e3:+.0f} and {standoff[1] * 1e3:+.0f} mm'
        )
    for note in answer.notes:
        yield f'note: {note}'


@click.command('plan')
@options.part_options(0.02)
@options.MODEL
@options.BRUSH
@options_of(PlanRequest)
@options.ZONES
@options.PART_POSE
@options.robot_options
@click.option(
    '--frame-id', help='Frame of the poses; default: part, or base_link with --part-pose.'
)
@click.option(
    '--faces', type=click.Choice(['one', 'auto']), default='one', show_default=True,
    help='auto: split the part into faces that can be sprayed from one side each, as a hood '
    'with its flange or a bumper, and blend their seams.',
)  # fmt: skip
@click.option(
    '--face-angle-deg', default=40.0, show_default=True, type=options.FiniteRange(5.0, 75.0),
    help='Largest angle between a normal of a face and their mean.',
)  # fmt: skip
@options_of(GunEnvelope, into='envelope')
@options.PAINT_MOVES
@options.results_options('the bag, passes.csv, passes.mod, plan.json and the film')
def plan_command(
    request: PlanRequest,
    envelope: GunEnvelope,
    part: dict[str, Any],
    robot: dict[str, Any],
    zones_file: Path | None,
    model_file: Path | None,
    brush: int,
    part_pose: list[float] | None,
    frame_id: str | None,
    faces: str,
    face_angle_deg: float,
    paint_moves: bool,
    results: options.Results,
) -> None:
    """Lay passes over a part: where they lie, how the gun moves, and the film to expect."""
    chosen, wanted = chosen_model(model_file, brush=brush), dict(request)
    model = chosen.model
    cell = options.robot_cell(robot, part_pose)
    frame_id = frame_id or ('part' if part_pose is None else 'base_link')
    with Progress('plan') as show:
        show('reading the mesh')
        surface = pd.read_mesh(**part)
        frame = frame_id if part_pose is None else 'part'
        given: dict[str, Any] = {
            'frame_id': frame, 'envelope': envelope, 'robot': cell, 'progress': show,
            'zones': options.zones_of(zones_file, part), **wanted,
        }  # fmt: skip
        result: pd.Plan | pd.PartPlan
        if faces == 'one':
            result = pd.plan(surface, model, **given)
        else:
            result = pd.plan_faces(surface, model, face_angle_deg=face_angle_deg, **given)
        show('writing')
        made_from = {
            'mesh': str(part['path']),
            'model': str(model_file or 'default'),
            'zones_file': str(zones_file or ''),
            'frame_id': frame_id,
            'part_pose': part_pose,
        }
        results.write(
            result, made_from=made_from, part_pose=part_pose, frame_id=frame_id,
            paint_moves=paint_moves,
        )  # fmt: skip
    options.print_all('note', surface.notes)
    options.print_all('warning', result.warnings)
    results.print(_plan_lines(result), model=chosen.words)


def _plan_lines(result: pd.Plan | pd.PartPlan) -> Iterator[str]:
    film = result.statistics
    yield result.sentence
    yield result.comparison
    whole = result.whole_part
    yield (
        f'film there {film.min_um:.1f} to {film.max_um:.1f} µm; on the whole part '
        f'{whole.min_um:.1f} to {whole.max_um:.1f} µm, mean {whole.mean_um:.1f} µm, coverage '
        f'{100 * whole.coverage:.0f} %, capture fraction '
        f'{100 * whole.capture_fraction:.0f} %'
    )
    first = result.unoptimised if isinstance(result, pd.Plan) else None
    yield from options.zone_lines(film.zones, first.statistics.zones if first else {})
    yield from options.paint_lines(result)
    if result.drive:
        yield result.drive.sentence
    gun = result.envelope
    if not result.contacts:
        yield (
            f'gun ({2e3 * gun.radius_m:.0f} mm wide, {1e3 * gun.length_m:.0f} mm long) and the '
            f'{1e3 * gun.before_m:.0f} mm before it keep clear of the part'
        )
    if isinstance(result, pd.Plan) and result.unoptimised:
        first, paint = result.unoptimised, result.unoptimised.statistics
        yield (
            f'without --optimise: {first.sentence}; paint {paint.emitted_volume_cm3:.1f} instead '
            f'of {film.emitted_volume_cm3:.1f} cm3, capture fraction '
            f'{100 * paint.capture_fraction:.0f} %'
        )
