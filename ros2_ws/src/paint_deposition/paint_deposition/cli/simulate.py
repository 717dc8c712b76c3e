"""The command `simulate`: the film on a part from a recorded trajectory."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from paint_deposition.cli.options import (
    FILE,
    GUN_SIGNAL,
    JSON,
    NOT_NEGATIVE,
    direction_option,
    max_edge_length_option,
    max_pose_gap_option,
    mesh_scale_option,
    model_option,
    output_option,
    read_given_model,
    say_all,
    say_files,
)
from paint_deposition.cli.progress import Progress
from paint_deposition.cli.results_folder import results_in

if TYPE_CHECKING:
    from paint_deposition.film.statistics import FilmStatistics
    from paint_deposition.motion.trajectory import PoseCounts


@click.command('simulate')
@click.option('--mesh', required=True, type=FILE, help='The part: STL, PLY or OBJ.')
@click.option(
    '--trajectory', required=True, type=FILE,
    help='Bag with the poses: ROS 1 .bag, rosbag2 folder (sqlite3 or MCAP) or a single .mcap; '
    'or a RAPID module, .mod or .prg, taken as programmed.',
)  # fmt: skip
@model_option('Deposition model, YAML; default: a 50 mm bell.')
@output_option('film.ply, film.csv, stats.json and film.png', required=True)
@click.option(
    '--at', 'readings_file', type=FILE,
    help='Gauge readings, CSV: also write predicted.csv, their columns and predicted_um, what '
    'the gauge should show at exactly those points: the film with effects on the gauge.',
)  # fmt: skip
@click.option('--pose-topic', help='Poses in the bag; default: its only PoseStamped topic.')
@click.option(
    '--state-topic',
    help='Trigger of the gun, AtomizerState or Bool; default: it sprays whenever poses flow.',
)
@GUN_SIGNAL
@mesh_scale_option()
@max_edge_length_option(0.01)
@max_pose_gap_option()
@direction_option(
    '--down', 'Gravity in the mesh frame; default: -z, or -y for a part that lies in x-y.'
)
@click.option('--target-um', default=0.0, type=NOT_NEGATIVE, help='Film wanted.')
@click.option('--tolerance-um', default=0.0, type=NOT_NEGATIVE,
              help='Accepted difference from the target, either way.')  # fmt: skip
@JSON
def simulate_command(
    mesh: Path,
    trajectory: Path,
    model_file: Path | None,
    output: Path,
    readings_file: Path | None,
    pose_topic: str | None,
    state_topic: str | None,
    gun_signal: str | None,
    mesh_scale: float,
    max_edge_length_m: float,
    max_pose_gap_s: float,
    down: tuple[float, float, float] | None,
    target_um: float,
    tolerance_um: float,
    as_json: bool,
) -> None:
    """Compute the film on a part from a recorded trajectory.

    film.csv and film.ply hold the film at the vertices of the refined mesh.
    """
    if tolerance_um and not target_um:
        raise click.UsageError('--tolerance-um has no --target-um; give both')
    with Progress('simulate') as tell:
        tell('loading')
        import numpy as np

        from paint_deposition.api.simulation import simulate
        from paint_deposition.api.writing import write
        from paint_deposition.files.gauge_readings import read_readings
        from paint_deposition.files.json_files import json_text
        from paint_deposition.files.meshes import read_mesh
        from paint_deposition.files.motion_files import read_recording

        tell('reading')
        model = read_given_model(model_file)
        readings = read_readings(readings_file) if readings_file else None
        recorded = read_recording(trajectory, pose_topic, state_topic, gun_signal)
        tell('refining the mesh')
        gravity = None if down is None else np.array(down)
        surface = read_mesh(mesh, mesh_scale, max_edge_length_m, gravity)
        film = simulate(
            surface, recorded, model, readings=readings, max_pose_gap_s=max_pose_gap_s,
            target_um=target_um, tolerance_um=tolerance_um, progress=tell,
        )  # fmt: skip
        made_from = {
            'mesh_file': str(mesh),
            'trajectory': str(trajectory),
            'model_file': str(model_file or ''),
        }
        tell('writing and drawing')
        with results_in(output) as folder:
            files = write(film, folder, made_from=made_from)
    say_all('note', film.notes, err=True)
    if film.warning:
        click.echo(f'warning: {film.warning}', err=True)
    if as_json:
        click.echo(json_text(film.to_dict() | made_from))
    else:
        _say(film.statistics, film.counts)
        say_files(files, output)


def _say(statistics: FilmStatistics, counts: PoseCounts) -> None:
    s = statistics
    click.echo(
        f'film {s.mean_um:.1f} µm mean, {s.std_dev_um:.1f} µm standard deviation, '
        f'{s.min_um:.1f} to {s.max_um:.1f} µm on the painted {100 * s.coverage:.1f} % of '
        f'{s.area_m2:.2f} m2'
    )
    if s.target_um:
        click.echo(
            f'{100 * s.within_target:.1f} % of it within {s.target_um:g} ± '
            f'{s.target_tolerance_um:g} µm'
        )
    if not math.isnan(s.capture_fraction):
        click.echo(
            f'{s.painted_volume_cm3:.2f} of {s.emitted_volume_cm3:.2f} cm3 on the part, '
            f'capture fraction {100 * s.capture_fraction:.0f} %'
        )
    if counts.rejected or counts.gaps or counts.restarts:
        click.echo(
            f'{counts.rejected} of {counts.received} poses dropped, {counts.gaps} gaps taken as '
            f'gun off, {counts.restarts} restarts'
        )
