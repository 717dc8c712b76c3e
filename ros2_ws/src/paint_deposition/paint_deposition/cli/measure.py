"""The command `measure`: where to put the gauge on a part."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

import paint_deposition as pd
from paint_deposition.cli import options
from paint_deposition.cli.model_choice import chosen_model, model_for
from paint_deposition.cli.options_of import options_of
from paint_deposition.cli.results_folder import Progress
from paint_deposition.planning.requests import FilmBuild, MeasureRequest

# Below this probability an effect is named as one that the part hardly shows.
HARDLY = 0.15


@click.command('measure')
@options.part_options(0.01)
@click.option(
    '--trajectory', type=options.FILE,
    help='The motion, as `simulate` takes it; default: passes as `plan` would lay them, '
    'with --target-um or --speed.',
)  # fmt: skip
@options.MODEL
@options.BRUSH
@options_of(MeasureRequest)
@options_of(FilmBuild, into='passes')
@options.motion_options
@options.MAX_POSE_GAP
@options.ALLOW_EFFECTS
@options.results_options('points.csv, poses.csv, points.png and measure.json')
def measure_command(
    request: MeasureRequest,
    passes: FilmBuild,
    part: dict[str, Any],
    trajectory: Path | None,
    model_file: Path | None,
    brush: int,
    motion: dict[str, Any],
    max_pose_gap_s: float,
    results: options.Results,
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
        surface = pd.read_mesh(**part)
        warnings: tuple[str, ...] = ()
        if trajectory is None:
            chosen = chosen_model(model_file, brush=brush)
            recorded = pd.plan(surface, chosen.model, progress=show, **dict(passes)).trajectory
        else:
            chosen = model_for(model_file, trajectory)
            recorded = pd.read_recording(trajectory, **motion)
            warnings = recorded.warnings
        posterior = chosen.file.posterior if chosen.file else None
        result = pd.choose_readings(
            surface, recorded, chosen.model, posterior=posterior, max_pose_gap_s=max_pose_gap_s,
            progress=show, **dict(request),
        )  # fmt: skip
        made_from = {
            'mesh_file': str(part['path']),
            'trajectory': str(trajectory or ''),
            'model_file': str(chosen.path or ''),
        }
        show('writing and drawing')
        results.write(result, made_from=made_from, part_pose=motion.get('part_pose'))
    options.print_all('note', result.surface.notes)
    options.print_all('warning', warnings)
    results.print(_lines(result), model=chosen.words)


def _lines(result: pd.ChosenReadings) -> Iterator[str]:
    yield result.sentence
    power = sorted(result.power.items(), key=lambda pair: -pair[1])
    for name, chance in power:
        if chance >= HARDLY:
            grid = result.grid_power[name]
            yield f'{name:>22} {100 * chance:3.0f} %   on a grid {100 * grid:3.0f} %'
    hidden = [name for name, chance in power if chance < HARDLY]
    if hidden:
        yield f'unlikely to be detected on this part at their typical size: {", ".join(hidden)}'
    yield (
        f'at least {result.apart_m * 1e3:.0f} mm from each other and {result.foot_m * 1e3:.0f} mm '
        f'off edges; {result.repeats} of them are to be read twice'
    )
