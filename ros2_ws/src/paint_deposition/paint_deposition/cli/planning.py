"""Commands that prepare a job: `calibrate`, `recommend` and `plan`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click

from paint_deposition.cli.options import (
    CAMPAIGN,
    FILE,
    JSON,
    NOT_NEGATIVE,
    NUMBER,
    POSITIVE,
    direction_option,
    max_edge_length_option,
    mesh_scale_option,
    model_option,
    output_option,
    read_given_model,
    read_noted,
    read_start,
    say_all,
    say_files,
    seed_option,
)
from paint_deposition.cli.progress import Progress
from paint_deposition.cli.results_folder import results_in

MODEL = model_option('Deposition model, YAML; default: a 50 mm bell.')
SPEED = click.option('--speed', 'speed_m_per_s', type=NUMBER, help='Speed of the passes [m/s].')
TARGET = click.option(
    '--target-um', type=NUMBER, help='Mean film build; the speed is chosen for it [µm].'
)
INDEX_MIN = click.option('--index-min', 'index_min_m', type=NUMBER, help='Least index [m].')
INDEX_MAX = click.option('--index-max', 'index_max_m', type=NUMBER, help='Greatest index [m].')
TOLERANCE = click.option(
    '--tolerance', type=NUMBER, help='Largest sigma_n accepted, 0.05 for 5 %.'
)
ONE_WAY = click.option(
    '--one-way', is_flag=True, help='Every pass in one direction; default: they alternate.'
)
STANDOFF = click.option(
    '--standoff', 'standoff_m', type=NUMBER,
    help='Distance of the TCP from the part [m]; default: the part lies on the model plane.',
)  # fmt: skip
TRAVEL = click.option(
    '--travel-deg', default=0.0, show_default=True, type=NUMBER,
    help="Direction of the first pass in the tool's x-y frame, from x to y.",
)  # fmt: skip


@click.command('calibrate')
@CAMPAIGN
@model_option("Model to start from; default: the campaign's, else a 50 mm bell.")
@output_option('model.yaml, calibration.json and pictures', required=True)
@seed_option('the starts of the fit')
@JSON
def calibrate_command(
    campaign: Path, model_file: Path | None, output: Path, seed: int, as_json: bool
) -> None:
    """Fit the bell's pattern to the gauge readings of CAMPAIGN.

    Any number of panels and parts may be in it; a flat panel painted by a few passes is best. The
    effects of the model to start from are fitted as well; its projection is kept.
    """
    from paint_deposition.api.inference import calibrate
    from paint_deposition.api.writing import write
    from paint_deposition.files.json_files import json_text

    with Progress('calibrate') as tell:
        data = read_noted(campaign, tell)
        start = read_start(data, model_file)
        result = calibrate(data, start.model if start else None, seed=seed, progress=tell)
        tell('writing')
        with results_in(output) as folder:
            files = write(result, folder, start=start)
    if as_json:
        click.echo(json_text(result.to_dict()))
        return
    for value in result.parameters:
        mark = '' if value.determined else '   not determined'
        click.echo(
            f'{value.name:>14} = {value.value:.4g}  ({value.low:.4g} to {value.high:.4g}){mark}'
        )
    for experiment, found in zip(result.study.campaign.experiments, result.residuals, strict=True):
        click.echo(
            f'{experiment.name}: {len(found)} points, mean {found.measured_um.mean():.2f} µm '
            f'measured, {found.predicted_um.mean():.2f} predicted, residual SD '
            f'{found.sd_um:.2f} µm'
        )
    noise = result.study.noise
    click.echo(
        f'chi2 per degree of freedom {result.chi_square_per_freedom:.2f}, gauge noise '
        f'{noise.typical_um:.2f} µm ({noise.source})'
    )
    say_all('warning', result.warnings, err=True)
    say_files(files, output)


@click.command('recommend')
@MODEL
@SPEED
@TARGET
@INDEX_MIN
@INDEX_MAX
@TOLERANCE
@click.option('--width', 'width_m', type=NUMBER, help='Width to paint across the passes [m].')
@click.option(
    '--length', 'length_m', type=NUMBER, help='Length of a pass [m]; default: the width.'
)
@ONE_WAY
@click.option(
    '--gun-turns', is_flag=True,
    help='The gun is turned by 180 deg for every way back; default: it keeps its orientation.',
)  # fmt: skip
@STANDOFF
@TRAVEL
@output_option(
    'recommendation.json and uniformity.png; default: the working directory', default='.'
)
@JSON
def recommend_command(
    model_file: Path | None,
    output: Path,
    as_json: bool,
    gun_turns: bool,
    travel_deg: float,
    **wanted: Any,
) -> None:
    """Recommend the index between passes for an even film, at --speed or for --target-um."""
    from paint_deposition.api.planning import recommend
    from paint_deposition.api.writing import write
    from paint_deposition.files.json_files import json_text

    answer = recommend(
        read_given_model(model_file), gun_turns=gun_turns, travel_rad=math.radians(travel_deg),
        **wanted,
    )  # fmt: skip
    with results_in(output) as folder:
        files = write(answer, folder)
    if as_json:
        click.echo(json_text(answer.to_dict()))
        return
    click.echo(answer.sentence)
    for minimum in answer.minima:
        click.echo(f'minimum: sigma_n {minimum.sigma_n:.4f} at {minimum.index_m:.4f} m')
    for low, high in answer.windows_m:
        click.echo(f'within tolerance: {low:.4f} to {high:.4f} m')
    if answer.index_drift_m and answer.standoff_drift_m:
        click.echo(
            f'the index may drift to {answer.index_drift_m[0]:.3f} and '
            f'{answer.index_drift_m[1]:.3f} m, the standoff by '
            f'{answer.standoff_drift_m[0] * 1e3:+.0f} and '
            f'{answer.standoff_drift_m[1] * 1e3:+.0f} mm'
        )
    say_all('note', answer.notes)
    say_files(files, output)


@click.command('plan')
@click.option('--mesh', required=True, type=FILE, help='STL, PLY or OBJ.')
@MODEL
@SPEED
@TARGET
@click.option(
    '--direction', default='horizontal', show_default=True,
    type=click.Choice(['horizontal', 'vertical']), help='How the passes run.',
)  # fmt: skip
@click.option('--index', 'index_m', type=NUMBER, help='Fixes the index [m]; default: most even.')
@INDEX_MIN
@INDEX_MAX
@TOLERANCE
@STANDOFF
@click.option('--smoothing-radius-m', default=0.1, show_default=True, type=POSITIVE,
              help='What is finer than this on the part is not followed.')  # fmt: skip
@click.option(
    '--overspray-m', type=NOT_NEGATIVE,
    help='The gun opens this far before the part; default: where 90 % of the pattern reach.',
)  # fmt: skip
@click.option('--acceleration', 'acceleration_m_per_s2', default=2.0, show_default=True,
              type=POSITIVE, help='Of the robot [m/s2].')  # fmt: skip
@ONE_WAY
@TRAVEL
@direction_option('--outward', 'From the part to the gun; default: the mean normal of the mesh.')
@direction_option('--down', 'Gravity in the mesh frame; default: -z, or -y for a lying part.')
@mesh_scale_option()
@max_edge_length_option(0.02)
@click.option('--frame-id', default='part', show_default=True, help='Frame of the poses.')
@output_option('the bag, passes.csv, passes.mod, plan.json and the film', required=True)
@JSON
def plan_command(
    mesh: Path,
    model_file: Path | None,
    output: Path,
    travel_deg: float,
    down: tuple[float, float, float] | None,
    mesh_scale: float,
    max_edge_length_m: float,
    frame_id: str,
    as_json: bool,
    **wanted: Any,
) -> None:
    """Lay passes over a part: where they lie, how the gun moves, and the film to expect."""
    import numpy as np

    from paint_deposition.api.planning import plan
    from paint_deposition.api.writing import write
    from paint_deposition.files.meshes import read_mesh

    model = read_given_model(model_file)
    with Progress('plan') as tell:
        tell('reading the mesh')
        gravity = None if down is None else np.array(down)
        surface = read_mesh(mesh, mesh_scale, max_edge_length_m, gravity)
        result = plan(
            surface, model, frame_id=frame_id, progress=tell, travel_rad=math.radians(travel_deg),
            **wanted,
        )  # fmt: skip
        made_from = {
            'mesh': str(mesh),
            'model': str(model_file) if model_file else 'default',
            'frame_id': frame_id,
        }
        tell('writing')
        with results_in(output) as folder:
            files = write(result, folder, made_from=made_from)
    say_all('note', surface.notes, err=True)
    if as_json:
        click.echo((output / 'plan.json').read_text(), nl=False)
        return
    click.echo(result.sentence)
    click.echo(
        f'on a plane: sigma_n {100 * result.plane.sigma_n:.1f} % at '
        f'{result.plane.index_m * 1e3:.0f} mm; those passes about the middle of this part: '
        f'{100 * result.plane_on_part.sigma_n:.1f} %'
    )
    click.echo(
        f'film {result.statistics.min_um:.1f} to {result.statistics.max_um:.1f} µm, coverage '
        f'{100 * result.statistics.coverage:.0f} %, '
        f'capture fraction {100 * result.statistics.capture_fraction:.0f} %'
    )
    say_files(files, output)
