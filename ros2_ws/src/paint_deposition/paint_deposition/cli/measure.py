"""The command `measure`: where to put the gauge on a part."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import paint_deposition as pd
from paint_deposition.cli.model_choice import chosen_model, model_for
from paint_deposition.cli.options import (
    BODY,
    BRUSH,
    FILE,
    JSON,
    MAX_POSE_GAP,
    MESH,
    MESH_SCALE,
    MODEL,
    NUMBER,
    PICTURES,
    POSITIVE,
    direction_option,
    file_lines,
    max_edge_length_option,
    motion_options,
    output_option,
    say_all,
    say_results,
    seed_option,
    write_results,
)
from paint_deposition.cli.progress import Progress

if TYPE_CHECKING:
    import numpy as np

    from paint_deposition.cli.model_choice import ChosenModel

# Below this probability an effect is named as one that the part hardly shows.
HARDLY = 0.15


@click.command('measure')
@MESH
@click.option(
    '--trajectory', type=FILE,
    help='How it is painted: what `simulate` takes; default: passes as `plan` would lay them, '
    'with --target-um or --speed.',
)  # fmt: skip
@MODEL
@BRUSH
@click.option('--points', default=60, show_default=True, help='How many points.')
@click.option(
    '--repeats', default=8, show_default=True,
    help='Points to be read twice, which tell the noise of the gauge; 0 if you know it.',
)  # fmt: skip
@click.option(
    '--foot-m', default=0.015, show_default=True, type=POSITIVE,
    help="Radius of the gauge's foot: points keep this far off edges and bends.",
)  # fmt: skip
@click.option('--target-um', type=NUMBER, help='Mean film of passes to be planned [µm].')
@click.option('--speed', 'speed_m_per_s', type=NUMBER, help='Speed of passes to be planned [m/s].')
@output_option('points.csv, poses.csv, points.mod, points.png and measure.json')
@seed_option('the places tried and the noise simulated')
@motion_options
@MESH_SCALE
@BODY
@max_edge_length_option(0.01)
@MAX_POSE_GAP
@direction_option(
    '--down', 'Gravity in the mesh frame; default: -z, or -y if drawn flat at z = 0.'
)
@PICTURES
@JSON
def measure_command(
    mesh: Path,
    trajectory: Path | None,
    model_file: Path | None,
    brush: int,
    target_um: float | None,
    speed_m_per_s: float | None,
    output: Path,
    motion: dict[str, Any],
    mesh_scale: float,
    body: str | None,
    max_edge_length_m: float,
    down: np.ndarray | None,
    pictures: str,
    as_json: bool,
    **wanted: Any,
) -> None:
    """Choose where to put the gauge on a part, so that missing effects are found soonest.

    Fill the column thickness_um of points.csv and give that file as the measurements of a
    campaign.
    """
    passes: dict[str, Any] = {'target_um': target_um, 'speed_m_per_s': speed_m_per_s}
    if trajectory is None and not any(passes.values()):
        raise click.UsageError(
            'it is not said how the part is painted; give --trajectory, or --target-um for passes '
            'as `plan` would lay them'
        )
    with Progress('measure') as tell:
        tell('reading')
        chosen = (
            model_for(model_file, trajectory)
            if trajectory
            else chosen_model(model_file, brush=brush)
        )
        surface = pd.read_mesh(mesh, mesh_scale, max_edge_length_m, down, body)
        warnings: tuple[str, ...] = ()
        if trajectory is None:
            recorded = pd.plan(surface, chosen.model, progress=tell, **passes).trajectory
        else:
            recorded = pd.read_recording(trajectory, **motion)
            warnings = recorded.warnings
        result = _chosen(surface, recorded, chosen, tell, wanted)
        made_from = {
            'mesh_file': str(mesh),
            'trajectory': str(trajectory or ''),
            'model_file': str(chosen.path or ''),
        }
        tell('writing and drawing')
        files = write_results(
            result, output, made_from=made_from, part_pose=motion.get('part_pose'),
            pictures=pictures,
        )  # fmt: skip
    say_all('note', result.surface.notes)
    say_all('warning', warnings)
    say_results(files, as_json, [*_lines(result), *file_lines(files)], model=chosen.words)


def _chosen(
    surface: pd.Surface,
    recorded: pd.Trajectory,
    chosen: ChosenModel,
    tell: Progress,
    wanted: dict[str, Any],
) -> pd.ChosenReadings:
    """The points, with all that the model's file tells of it."""
    posterior = chosen.file.posterior if chosen.file else None
    return pd.choose_readings(
        surface, recorded, chosen.model, posterior=posterior, progress=tell, **wanted
    )


def _lines(result: pd.ChosenReadings) -> Iterator[str]:
    yield result.sentence
    power = sorted(result.power.items(), key=lambda pair: -pair[1])
    for name, chance in power:
        if chance >= HARDLY:
            grid = result.grid_power[name]
            yield f'{name:>22} {100 * chance:3.0f} %   on a grid {100 * grid:3.0f} %'
    hidden = [name for name, chance in power if chance < HARDLY]
    if hidden:
        yield f'hardly to be found on this part at their typical size: {", ".join(hidden)}'
    yield (
        f'at least {result.apart_m * 1e3:.0f} mm from each other and {result.foot_m * 1e3:.0f} mm '
        f'off edges; {result.repeats} of them are to be read twice'
    )
