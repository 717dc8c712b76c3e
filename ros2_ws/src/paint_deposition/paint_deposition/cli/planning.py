"""Commands that lay out passes: `recommend` and `plan`."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import reduce
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import paint_deposition as pd
from paint_deposition.cli.faces import faces_lines, faces_options
from paint_deposition.cli.model_choice import chosen_model
from paint_deposition.cli.options import (
    BODY,
    BRUSH,
    FILE,
    JSON,
    MESH_SCALE,
    MODEL,
    NOT_NEGATIVE,
    NUMBER,
    PARETO,
    PART_POSE,
    PICTURES,
    POSITIVE,
    FiniteRange,
    direction_option,
    file_lines,
    max_edge_length_option,
    output_option,
    paint_lines,
    say_all,
    say_results,
    write_results,
)
from paint_deposition.cli.progress import Progress
from paint_deposition.planning.trade_off import PAINT_WEIGHTS, Point

if TYPE_CHECKING:
    import numpy as np

# How the passes of `recommend` and `plan` are to be.
PASSES = (
    click.option('--speed', 'speed_m_per_s', type=NUMBER, help='Speed of the passes [m/s].'),
    click.option(
        '--target-um', type=NUMBER, help='Mean film build; the speed is chosen for it [µm].'
    ),
    click.option('--index-min', 'index_min_m', type=NUMBER, help='Least index [m].'),
    click.option('--index-max', 'index_max_m', type=NUMBER, help='Greatest index [m].'),
    click.option('--tolerance', type=NUMBER, help='Largest sigma_n accepted, 0.05 for 5 %.'),
    click.option(
        '--one-way', is_flag=True, help='Every pass in one direction; default: they alternate.'
    ),
    click.option(
        '--standoff', 'standoff_m', type=NUMBER,
        help='Distance of the TCP from the part [m]; default: the part lies on the model plane.',
    ),
    click.option(
        '--travel-deg', default=0.0, show_default=True, type=NUMBER,
        help="Direction of the first pass in the tool's x-y frame, from x to y.",
    ),
)  # fmt: skip


def passes_wanted(command: Callable) -> Callable:
    """Give a command the options ``PASSES``, in that order."""
    return reduce(lambda taken, option: option(taken), reversed(PASSES), command)


@click.command('recommend')
@MODEL
@BRUSH
@passes_wanted
@click.option('--width', 'width_m', type=NUMBER, help='Width to paint across the passes [m].')
@click.option(
    '--length', 'length_m', type=NUMBER, help='Length of a pass [m]; default: the width.'
)
@click.option(
    '--gun-turns', is_flag=True,
    help='The gun is turned by 180 deg for every way back; default: it keeps its orientation.',
)  # fmt: skip
@output_option('recommendation.json and uniformity.png; default: the working directory', '.')
@PICTURES
@JSON
def recommend_command(
    model_file: Path | None,
    brush: int,
    output: Path,
    pictures: str,
    as_json: bool,
    travel_deg: float,
    **wanted: Any,
) -> None:
    """Recommend the index between passes for an even film, at --speed or for --target-um."""
    chosen = chosen_model(model_file, brush=brush)
    travel_rad = math.radians(travel_deg)
    answer = pd.recommend(chosen.model, travel_rad=travel_rad, **wanted)
    files = write_results(
        answer, output, pictures=pictures, model=chosen.model,
        made_from={'model_file': str(model_file or '')},
    )  # fmt: skip
    lines = [*_recommendation_lines(answer), *file_lines(files)]
    say_results(files, as_json, lines, model=chosen.words)


def _recommendation_lines(answer: pd.Recommendation) -> Iterator[str]:
    yield answer.sentence
    for minimum in answer.minima:
        yield f'minimum: sigma_n {minimum.sigma_n:.4f} at {minimum.index_m:.4f} m'
    for low, high in answer.windows_m:
        yield f'within tolerance: {low:.4f} to {high:.4f} m'
    if answer.index_drift_m and answer.standoff_drift_m:
        yield (
            f'the index may drift to {answer.index_drift_m[0]:.3f} and '
            f'{answer.index_drift_m[1]:.3f} m, the standoff by '
            f'{answer.standoff_drift_m[0] * 1e3:+.0f} and '
            f'{answer.standoff_drift_m[1] * 1e3:+.0f} mm'
        )
    for note in answer.notes:
        yield f'note: {note}'


@click.command('plan')
@click.option('--mesh', required=True, type=FILE, help='STL, PLY, OBJ, glTF, 3MF or STEP.')
@MODEL
@BRUSH
@passes_wanted
@click.option(
    '--direction', default='horizontal', show_default=True,
    type=click.Choice(['horizontal', 'vertical']), help='How the passes run.',
)  # fmt: skip
@click.option('--index', 'index_m', type=NUMBER, help='Fixes the index [m]; default: most even.')
@click.option('--smoothing-radius-m', default=0.1, show_default=True, type=POSITIVE,
              help='What is finer than this on the part is not followed.')  # fmt: skip
@click.option(
    '--overspray-m', type=NOT_NEGATIVE,
    help='The gun opens this far before the part; default: where 90 % of the pattern reach.',
)  # fmt: skip
@click.option('--acceleration', 'acceleration_m_per_s2', default=2.0, show_default=True,
              type=POSITIVE, help='Of the robot [m/s2].')  # fmt: skip
@click.option(
    '--optimise', is_flag=True,
    help='Choose number and place of the passes and the speeds along them for an even film and '
    'little paint; default: even passes at one speed.',
)  # fmt: skip
@click.option(
    '--paint-weight', type=NOT_NEGATIVE, default=5e-3, show_default=True,
    help='With --optimise: what paint is worth, in units of sigma_n squared, for as much as the '
    'film on the part holds.',
)  # fmt: skip
@click.option(
    '--time-weight', type=NOT_NEGATIVE, default=5e-3, show_default=True,
    help='With --optimise: the same for the time of the plan without it.',
)  # fmt: skip
@click.option(
    '--speed-min', 'speed_min_m_per_s', type=POSITIVE, default=0.1, show_default=True,
    help='With --optimise: least speed while spraying [m/s].',
)  # fmt: skip
@click.option(
    '--speed-max', 'speed_max_m_per_s', type=POSITIVE, default=1.0, show_default=True,
    help='With --optimise: greatest speed while spraying [m/s].',
)  # fmt: skip
@click.option(
    '--standoff-min', 'standoff_min_m', type=POSITIVE,
    help='With --optimise: each pass may have a standoff of its own, from this one on [m].',
)  # fmt: skip
@click.option(
    '--standoff-max', 'standoff_max_m', type=POSITIVE,
    help='With --optimise: up to this one [m].',
)  # fmt: skip
@click.option(
    '--lean-max-deg', default=0.0, show_default=True, type=FiniteRange(0.0, 45.0),
    help='With --optimise: the gun may be turned so far about the line of a pass.',
)  # fmt: skip
@PARETO
@direction_option('--outward', 'From the part to the gun; default: the mean normal of the mesh.')
@direction_option('--down', 'Gravity in the mesh frame; -z, or -y if drawn flat at z = 0.')
@MESH_SCALE
@BODY
@max_edge_length_option(0.02)
@PART_POSE
@click.option(
    '--frame-id', help='Frame of the poses; default: part, or base_link with --part-pose.'
)
@faces_options
@output_option('the bag, passes.csv, passes.mod, plan.json and the film')
@PICTURES
@JSON
def plan_command(
    mesh: Path,
    model_file: Path | None,
    brush: int,
    output: Path,
    travel_deg: float,
    down: np.ndarray | None,
    mesh_scale: float,
    body: str | None,
    max_edge_length_m: float,
    part_pose: list[float] | None,
    frame_id: str | None,
    pareto: bool,
    pictures: str,
    as_json: bool,
    lay: Callable[..., tuple[pd.Plan | pd.PartPlan, tuple]],
    lean_max_deg: float,
    **wanted: Any,
) -> None:
    """Lay passes over a part: where they lie, how the gun moves, and the film to expect."""
    if pareto and not wanted['optimise']:
        raise click.UsageError('--pareto weighs paint in an optimised plan; add --optimise')
    wanted |= {'travel_rad': math.radians(travel_deg), 'lean_max_rad': math.radians(lean_max_deg)}
    chosen = chosen_model(model_file, brush=brush)
    frame_id = frame_id or ('part' if part_pose is None else 'base_link')
    with Progress('plan') as tell:
        tell('reading the mesh')
        surface = pd.read_mesh(mesh, mesh_scale, max_edge_length_m, down, body)
        result, contacts = lay(
            surface, chosen.model, frame_id=frame_id if part_pose is None else 'part',
            progress=tell, **wanted,
        )  # fmt: skip
        made_from = {
            'mesh': str(mesh),
            'model': str(model_file or 'default'),
            'frame_id': frame_id,
            'part_pose': part_pose,
        }
        others: list[Point] = []
        if pareto:
            others = [
                pd.plan(
                    surface, chosen.model, progress=tell, **wanted | {'paint_weight': weight}
                ).point
                for weight in PAINT_WEIGHTS
            ]  # fmt: skip
        tell('writing')
        files = write_results(
            result, output, made_from=made_from, part_pose=part_pose, frame_id=frame_id,
            pictures=pictures, trade_off=others,
        )  # fmt: skip
    say_all('note', surface.notes)
    say_all('warning', map(str, contacts))
    told = faces_lines(result) if isinstance(result, pd.PartPlan) else _plan_lines(result)
    lines = [*told, *file_lines(files)]
    say_results(files, as_json, lines, model=chosen.words)


def _plan_lines(result: pd.Plan) -> Iterator[str]:
    film = result.statistics
    yield result.sentence
    yield (
        f'on a plane: sigma_n {100 * result.plane.sigma_n:.1f} % at '
        f'{result.plane.index_m * 1e3:.0f} mm; those passes about the middle of this part: '
        f'{100 * result.plane_on_part.sigma_n:.1f} %'
    )
    yield (
        f'film {film.min_um:.1f} to {film.max_um:.1f} µm, coverage {100 * film.coverage:.0f} %, '
        f'capture fraction {100 * film.capture_fraction:.0f} %'
    )
    yield from paint_lines(result)
    if len({(planned.style.standoff_m, planned.style.lean_rad) for planned in result.passes}) > 1:
        yield 'standoff and lean, pass by pass: ' + ', '.join(
            f'{planned.style.standoff_m * 1e3:.0f} mm '
            f'{math.degrees(planned.style.lean_rad):+.0f} deg'
            for planned in result.passes
        )
    if result.plain:
        plain, paint = result.plain, result.plain.statistics
        yield (
            f'without --optimise: {plain.sentence}; paint {paint.emitted_volume_cm3:.1f} instead '
            f'of {film.emitted_volume_cm3:.1f} cm3, capture fraction '
            f'{100 * paint.capture_fraction:.0f} %'
        )
