"""The command `improve`: speeds, flows and triggers of a given programme for a more even film."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

import paint_deposition as pd
from paint_deposition.cli import options
from paint_deposition.cli.model_choice import model_for
from paint_deposition.cli.options_of import options_of
from paint_deposition.cli.results_folder import Progress
from paint_deposition.planning.requests import ImproveRequest


@click.command('improve')
@options.part_options(0.02)
@click.option(
    '--trajectory', required=True, type=options.FILE,
    help='The programme: a bag, a table of poses, or a RAPID module, taken as programmed.',
)  # fmt: skip
@options.MODEL
@click.option(
    '--rival', 'rivals', type=options.FILE, multiple=True,
    help='Another model that explains the readings equally well; the film is optimised for all.',
)  # fmt: skip
@options_of(ImproveRequest)
@options.ZONES
@options.seed_option('the models drawn from the posterior of the model file')
@options.motion_options
@options.PAINT_MOVES
@options.JOINT_ACCELERATION
@options.ALLOW_EFFECTS
@options.results_options(
    'the bag, passes.csv, passes.mod, improvement.json, the picture and the film'
)
def improve_command(
    request: ImproveRequest,
    part: dict[str, Any],
    trajectory: Path,
    model_file: Path | None,
    rivals: tuple[Path, ...],
    zones_file: Path | None,
    paint_moves: bool,
    seed: int,
    motion: dict[str, Any],
    joint_acceleration: float | None,
    results: options.Results,
) -> None:
    """Make the film of a given programme more even; its path stays as it is.

    Speeds along the passes, flows and the places where the gun opens and closes are chosen
    through the whole model. What changes is printed pass by pass. With --urdf and --part-pose no
    joint of the robot is faster than it can be.
    """
    from paint_deposition.files.motion_files import holds_joints

    with Progress('improve') as show:
        show('reading')
        chosen = model_for(model_file, trajectory)
        robot = {name: motion[name] for name in ('urdf', 'tip_link', 'base_link')}
        limits = {'joint_acceleration': joint_acceleration}
        part_pose = motion['part_pose']
        cell = options.robot_cell(robot | limits, part_pose) if part_pose else None
        known = motion if holds_joints(trajectory) else motion | dict.fromkeys(robot)
        recorded = pd.read_recording(trajectory, **known)
        show('refining the mesh')
        surface = pd.read_mesh(**part)
        result = pd.improve(
            surface, recorded, chosen.model,
            posterior=chosen.file.posterior if chosen.file else None,
            rivals=[pd.read_model(path) for path in rivals], robot=cell,
            zones=options.zones_of(zones_file, part), seed=seed, progress=show, **dict(request),
        )  # fmt: skip
        made_from = {
            'mesh_file': str(part['path']),
            'trajectory': str(trajectory),
            'model_file': str(chosen.path or ''),
            'rivals': [str(path) for path in rivals],
            'zones_file': str(zones_file or ''),
            'part_pose': motion.get('part_pose'),
        }
        show('writing and drawing')
        results.write(
            result, made_from=made_from, part_pose=motion.get('part_pose'),
            paint_moves=paint_moves,
        )  # fmt: skip
    options.print_all('note', [*result.surface.notes, *recorded.notes, *result.notes])
    options.print_all('warning', result.warnings)
    results.print(_lines(result), model=chosen.words)


def _lines(result: pd.Improvement) -> Iterator[str]:
    before, after = result.before, result.after
    yield f'{result.region}:'
    yield result.sentence
    films = {'there': (before.statistics, after.statistics)}
    if not result.target_region.all():
        films['on the whole part'] = before.whole_part, after.whole_part
    for where, (a, b) in films.items():
        yield (
            f'film {where}: mean {a.mean_um:.1f} → {b.mean_um:.1f} µm; {a.min_um:.1f} to '
            f'{a.max_um:.1f} µm before, {b.min_um:.1f} to {b.max_um:.1f} µm after'
        )
    yield from options.zone_lines(after.statistics.zones, before.statistics.zones)
    for change in result.changes:
        yield change.sentence
    yield from result.limit_sentences
    if result.drive:
        yield result.drive.sentence
    yield (
        'the robot program lays the film of the bag within '
        f'{100 * result.program_difference:.2f} % of its peak'
    )
