"""The command `simulate`: the film on a part from a recorded trajectory."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from tqdm import tqdm

from paint_deposition.cli.options import (
    FILE,
    GUN_SIGNAL,
    JSON,
    NOT_NEGATIVE,
    SHOW_PROGRESS_AFTER_S,
    direction_option,
    max_edge_length_option,
    max_pose_gap_option,
    mesh_scale_option,
    model_option,
    output_option,
)
from paint_deposition.errors import PaintError

if TYPE_CHECKING:
    import numpy as np

    from paint_deposition.effects.deposition_model import DepositionModel
    from paint_deposition.film.integrator import FilmIntegrator
    from paint_deposition.film.statistics import FilmStatistics
    from paint_deposition.motion.path import SprayPath
    from paint_deposition.motion.trajectory import PoseCounts
    from paint_deposition.part.surface import Surface
    from paint_deposition.readings.readings import Readings

STAGES = ('loading', 'reading', 'refining the mesh', 'painting', 'writing', 'drawing')


@click.command('simulate')
@click.option('--mesh', required=True, type=FILE, help='The part: STL, PLY or OBJ.')
@click.option(
    '--trajectory', required=True, type=FILE,
    help='Bag with the poses: ROS 1 .bag, rosbag2 folder (sqlite3 or MCAP) or a single .mcap; '
    'or a RAPID module, .mod or .prg, taken as programmed.',
)  # fmt: skip
@model_option('Deposition model, YAML; default: a 50 mm bell.')
@output_option(
    'Folder for film.ply, film.csv, stats.json and film.png; older ones are replaced.',
    required=True,
)
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

    Nothing is written before everything is computed, and each file appears whole. film.csv and
    film.ply hold the film at the vertices of the refined mesh.
    """
    if tolerance_um and not target_um:
        raise click.UsageError('--tolerance-um has no --target-um; give both')
    with _progress() as (tell, advance):
        tell('loading')
        import numpy as np

        from paint_deposition.effects.deposition_model import DepositionModel
        from paint_deposition.files.gauge_readings import read_readings, write_predictions
        from paint_deposition.files.json_files import json_text
        from paint_deposition.files.meshes import read_mesh
        from paint_deposition.files.model_file import read_model
        from paint_deposition.files.motion_files import read_motion
        from paint_deposition.film.statistics import film_statistics
        from paint_deposition.motion.path_builder import spray_path
        from paint_deposition.results.film import write_film

        tell('reading')
        model = read_model(model_file) if model_file else DepositionModel()
        readings = read_readings(readings_file) if readings_file else None
        recorded = read_motion(trajectory, pose_topic, state_topic, gun_signal)
        path, counts = spray_path(recorded, max_pose_gap_s, model.max_step_m)
        _require_motion(trajectory, path, counts, max_pose_gap_s)
        tell('refining the mesh')
        gravity = None if down is None else np.array(down)
        surface = read_mesh(mesh, mesh_scale, max_edge_length_m, gravity)
        surface = _toward_the_gun(surface, path)
        tell('painting')
        film = _painted(surface, path, model, advance)
        film_um = film.film_um
        statistics = film_statistics(
            film_um, surface.vertex_areas_m2, film.emitted_cm3,
            target_um=target_um, target_tolerance_um=tolerance_um,
        )  # fmt: skip
        predicted_um = None
        if readings is not None:
            predicted_um = _predicted_um(mesh.stem, surface, path, readings, model)
        details = {
            'mesh_file': str(mesh),
            'trajectory': str(trajectory),
            'frame_id': recorded.frame_id,
            'down': surface.down.tolist(),
            'model_file': str(model_file or ''),
            'effects': [effect.id for effect in model.effects],
            'spraying_time_s': path.spraying_time_s,
            'poses': counts.as_dict(),
            'notes': [*surface.notes, *recorded.notes],
        }
        tell('writing')
        film = write_film(output, surface, film_um, statistics, details=details, overwrite=True)
        files = [output / file.name for file in film]
        if readings_file is not None:
            files.append(output / 'predicted.csv')
            write_predictions(files[-1], readings_file, predicted_um)
        tell('drawing')
        files.append(_draw(output, surface, film_um, statistics, details, path))
    for note in details['notes']:
        click.echo(f'note: {note}', err=True)
    if statistics.coverage == 0.0:
        click.echo(f'warning: the part stays bare: {_why_bare(surface, path)}', err=True)
    if as_json:
        click.echo(json_text(statistics.as_dict() | details))
    else:
        _say(statistics, counts, files)


def _require_motion(
    trajectory: Path, path: SprayPath, counts: PoseCounts, max_pose_gap_s: float
) -> None:
    if len(path):
        return
    reasons = {
        'not finite': counts.not_finite,
        'without a unit quaternion': counts.not_unit_quaternions,
        'with a repeated stamp': counts.repeated_stamps,
        'with a backward stamp': counts.backward_stamps,
        f'after a gap of more than {max_pose_gap_s:g} s': counts.gaps,
    }
    found = ', '.join(f'{count} {what}' for what, count in reasons.items() if count)
    raise PaintError(
        f'{trajectory}: no two of its {counts.received} poses make a motion'
        f'{f" ({found})" if found else ""}; record again, or see --max-pose-gap-s'
    )


def _toward_the_gun(surface: Surface, path: SprayPath) -> Surface:
    from paint_deposition.part.facing import toward_the_gun

    return toward_the_gun(surface, path.position_m, path.rotation[:, :, 2])


def _painted(
    surface: Surface, path: SprayPath, model: DepositionModel, advance: Callable[[float], None]
) -> FilmIntegrator:
    from paint_deposition.film.integrator import FilmIntegrator

    integrator = FilmIntegrator(surface.points(), model, occluder=surface.occluder)
    integrator.add(path, lambda done: advance(done / len(path)))
    return integrator


def _predicted_um(
    name: str, surface: Surface, path: SprayPath, readings: Readings, model: DepositionModel
) -> np.ndarray:
    """(N,) what the gauge should show at each reading [um], in double precision."""
    import numpy as np

    from paint_deposition.fitting.forward import Forward
    from paint_deposition.readings.campaign import Campaign, Experiment

    each = replace(readings, point=np.arange(len(readings)).astype(str))
    experiment = Experiment.of(name, surface, path, each)
    return Forward(Campaign((experiment,))).predict_um(model)


def _draw(
    output: Path,
    surface: Surface,
    film_um: np.ndarray,
    statistics: FilmStatistics,
    details: dict[str, Any],
    path: SprayPath,
) -> Path:
    from paint_deposition.report.pictures.film import write_door_picture

    model = Path(details['model_file']).name or 'default model'
    subtitle = f'{Path(details["trajectory"]).name}, {model}'
    title = f'Film on {Path(details["mesh_file"]).name}'
    picture = output / 'film.png'
    return write_door_picture(picture, surface, film_um, path, statistics, title, subtitle)


def _why_bare(surface: Surface, path: SprayPath) -> str:
    import numpy as np

    from paint_deposition.part.facing import facing

    spraying = path.select(path.flow > 0.0)
    if not len(spraying):
        return 'the gun never sprays; check --state-topic'
    seen = facing(surface, spraying.position_m, spraying.rotation[:, :, 2])
    distance = np.linalg.norm(spraying.position_m - surface.centre_m, axis=1).min()
    if not seen.front:
        return (
            f'the gun never looks at it and stays {distance:.3g} m or more from its centre; '
            'check that mesh and poses are in one frame, and --mesh-scale'
        )
    return f'the gun sprays {path.spraying_time_s:.3g} s only'


def _say(statistics: FilmStatistics, counts: PoseCounts, files: list[Path]) -> None:
    s = statistics
    click.echo(
        f'film {s.mean_um:.1f} um mean, {s.std_dev_um:.1f} um standard deviation, '
        f'{s.min_um:.1f} to {s.max_um:.1f} um on the painted {100 * s.coverage:.1f} % of '
        f'{s.area_m2:.2f} m2'
    )
    if s.target_um:
        click.echo(
            f'{100 * s.within_target:.1f} % of it within {s.target_um:g} +- '
            f'{s.target_tolerance_um:g} um'
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
    for file in files:
        click.echo(f'  {file}')


@contextmanager
def _progress() -> Iterator[tuple[Callable[[str], None], Callable[[float], None]]]:
    """A bar over the stages: functions to name the next one and how far the present one is."""
    with tqdm(
        total=len(STAGES), bar_format='{desc}: {percentage:3.0f}%|{bar}| [{elapsed}]',
        delay=SHOW_PROGRESS_AFTER_S, disable=None, leave=False,
    ) as bar:  # fmt: skip

        def advance(done: float) -> None:
            bar.update(STAGES.index(bar.desc) + done - bar.n)

        def tell(stage: str) -> None:
            bar.set_description_str(stage, refresh=False)
            advance(0.0)

        yield tell, advance
