"""The command `improve`: speeds, flows and triggers of a given programme for a more even film."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import reduce
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import paint_deposition as pd
from paint_deposition.cli.model_choice import model_for
from paint_deposition.cli.options import (
    BODY,
    FILE,
    JSON,
    MESH,
    MESH_SCALE,
    MODEL,
    NOT_NEGATIVE,
    NUMBER,
    PARETO,
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
from paint_deposition.planning.trade_off import PAINT_WEIGHTS, Point

if TYPE_CHECKING:
    import numpy as np

# What robot, gun and shop allow, and what is wanted: the fields of Limits and Wish.
LIMITS = (
    click.option(
        '--target-um', type=POSITIVE, help='Mean film wanted [µm]; default: that of the programme.'
    ),
    click.option(
        '--tolerance', type=POSITIVE,
        help='Accepted difference from the target, 0.1 for 10 %; film outside counts more.',
    ),
    click.option(
        '--paint-weight', type=NOT_NEGATIVE, default=3e-3, show_default=True,
        help='What all the paint of the programme is worth, in units of sigma_n squared.',
    ),
    click.option(
        '--time-weight', type=NOT_NEGATIVE, default=0.0, show_default=True,
        help='The same of the time sprayed.',
    ),
    click.option(
        '--smoothness', type=NOT_NEGATIVE, default=1e-2, show_default=True,
        help='Weight of changes of speed; more gives calmer passes.',
    ),
    click.option(
        '--speed-min', 'speed_min_m_per_s', type=POSITIVE, default=0.1, show_default=True,
        help='Least speed while spraying [m/s].',
    ),
    click.option(
        '--speed-max', 'speed_max_m_per_s', type=POSITIVE, default=1.0, show_default=True,
        help='Greatest speed while spraying [m/s].',
    ),
    click.option(
        '--acceleration', 'acceleration_m_per_s2', type=POSITIVE, default=2.0, show_default=True,
        help='Of the robot along its path [m/s2].',
    ),
    click.option(
        '--jerk', 'jerk_m_per_s3', type=POSITIVE, default=50.0, show_default=True,
        help='Of the robot [m/s3].',
    ),
    click.option(
        '--move-min', 'move_min_m', type=POSITIVE, default=0.02, show_default=True,
        help='Shortest move of the robot program while spraying [m].',
    ),
    click.option(
        '--settings-per-s', type=POSITIVE, default=20.0, show_default=True,
        help='Moves with a speed of their own that the controller follows in a second.',
    ),
    click.option(
        '--flow', 'flow', type=NUMBER, nargs=2, metavar='MIN MAX', default=(1.0, 1.0),
        show_default=True, help='Range of the flow of a pass, relative to the programmed one.',
    ),
    click.option(
        '--trigger-shift', 'trigger_shift_m', type=NOT_NEGATIVE, default=0.1, show_default=True,
        help='The gun opens earlier and closes later by this much at most [m].',
    ),
    click.option(
        '--trigger-cut', 'trigger_cut_m', type=NOT_NEGATIVE, default=0.3, show_default=True,
        help='The gun opens later and closes earlier by this much at most [m].',
    ),
    click.option('--film-min-um', type=POSITIVE, help='Least film accepted anywhere [µm].'),
    click.option('--film-max-um', type=POSITIVE, help='Greatest film accepted anywhere [µm].'),
)  # fmt: skip


def limits_wanted(command: Callable) -> Callable:
    """Give a command the options ``LIMITS``, in that order."""
    return reduce(lambda taken, option: option(taken), reversed(LIMITS), command)


@click.command('improve')
@MESH
@click.option(
    '--trajectory', required=True, type=FILE,
    help='The programme: a bag, a table of poses, or a RAPID module, taken as programmed.',
)  # fmt: skip
@MODEL
@click.option(
    '--rival', 'rivals', type=FILE, multiple=True,
    help='Another model that explains the readings as well; the film is made even for all.',
)  # fmt: skip
@output_option('the bag, passes.csv, passes.mod, improvement.json, the picture and the film')
@limits_wanted
@PARETO
@seed_option('the models drawn from what the model file knows')
@motion_options
@MESH_SCALE
@BODY
@max_edge_length_option(0.02)
@direction_option('--down', 'Gravity in the mesh frame; -z, or -y if drawn flat at z = 0.')
@PICTURES
@JSON
def improve_command(
    mesh: Path,
    trajectory: Path,
    model_file: Path | None,
    rivals: tuple[Path, ...],
    output: Path,
    seed: int,
    motion: dict[str, Any],
    mesh_scale: float,
    body: str | None,
    max_edge_length_m: float,
    down: np.ndarray | None,
    flow: tuple[float, float],
    pareto: bool,
    pictures: str,
    as_json: bool,
    **wanted: Any,
) -> None:
    """Make the film of a given programme more even; its path stays as it is.

    Speeds along the passes, flows and the places where the gun opens and closes are chosen anew,
    through the whole model. What changes is told pass by pass; the bag and the robot program are
    read back, and all figures are of their film.
    """
    with Progress('improve') as tell:
        tell('reading')
        chosen = model_for(model_file, trajectory)
        recorded = pd.read_recording(trajectory, **motion)
        tell('refining the mesh')
        surface = pd.read_mesh(mesh, mesh_scale, max_edge_length_m, down, body)
        rest: dict[str, Any] = {
            'posterior': chosen.file.posterior if chosen.file else None,
            'rivals': [pd.read_model(path) for path in rivals],
            'seed': seed, 'flow_min': flow[0], 'flow_max': flow[1], 'progress': tell,
        }  # fmt: skip
        result = pd.improve(surface, recorded, chosen.model, **rest, **wanted)
        others: list[Point] = []
        if pareto:
            rest |= {'judged': result.judged}
            others = [
                pd.improve(
                    result.surface, recorded, chosen.model,
                    **rest, **wanted | {'paint_weight': weight},
                ).points[1]
                for weight in PAINT_WEIGHTS
            ]  # fmt: skip
        made_from = {
            'mesh_file': str(mesh),
            'trajectory': str(trajectory),
            'model_file': str(chosen.path or ''),
            'rivals': [str(path) for path in rivals],
            'part_pose': motion.get('part_pose'),
        }
        tell('writing and drawing')
        files = write_results(
            result, output, made_from=made_from, part_pose=motion.get('part_pose'),
            pictures=pictures, trade_off=others,
        )  # fmt: skip
    say_all('note', [*result.surface.notes, *recorded.notes])
    say_all('warning', [*recorded.warnings, *result.warnings])
    lines = [*_lines(result), *file_lines(files)]
    say_results(files, as_json, lines, model=chosen.words)


def _lines(result: pd.Improvement) -> Iterator[str]:
    before, after, surface = result.before, result.after, result.surface
    judged = surface.vertex_areas_m2[result.judged].sum()
    yield f'judged: {judged:.2f} of {surface.area_m2:.2f} m2, what the programme paints'
    yield result.sentence
    yield (
        f'film {before.min_um:.1f} to {before.max_um:.1f} µm before, {after.min_um:.1f} to '
        f'{after.max_um:.1f} µm after; mean {before.mean_um:.1f} and {after.mean_um:.1f} µm'
    )
    if result.sigma_n_interval:
        (low, high), (new_low, new_high) = result.sigma_n_interval
        yield (
            f'with what is not known of the model: sigma_n {100 * low:.1f} to {100 * high:.1f} % '
            f'before, {100 * new_low:.1f} to {100 * new_high:.1f} % after'
        )
    for change in result.changes:
        yield change.sentence
    yield from result.limit_sentences
    yield (
        'the robot program lays the film of the bag within '
        f'{100 * result.program_difference:.2f} % of its peak'
    )
