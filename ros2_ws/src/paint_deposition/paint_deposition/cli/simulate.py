"""Commands on one part: `simulate`, `sweep` over variations, where to `measure`, `locate` it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import paint_deposition as pd
from paint_deposition.cli import options
from paint_deposition.cli.models import chosen_model, model_for, models_for
from paint_deposition.cli.results import (
    Results,
    inputs,
    print_all,
    progress,
    results_options,
    zone_lines,
)
from paint_deposition.errors import RecordingError
from paint_deposition.planning.requests import MeasureRequest, PlanRequest
from paint_deposition.request import MotionOptions, validate

if TYPE_CHECKING:
    from paint_deposition.film.statistics import FilmStatistics


@click.command('simulate')
@options.part_options(0.01, zones=True)
@click.option(
    '--trajectory', 'trajectories', required=True, multiple=True, type=options.FILE,
    help='Bag with the poses: ROS 1 .bag, rosbag2 folder (sqlite3 or MCAP) or a single .mcap; a '
    'table of poses; or a RAPID module, .mod or .prg, taken as programmed. Give one for each of '
    'several guns.',
)  # fmt: skip
@click.option(
    '--atomizer', 'atomizers', multiple=True, metavar='NAME',
    help='Gun of a bag whose topics stand behind its name, NAME/atomizer/pose and '
    'NAME/atomizer/state; once for each gun.',
)  # fmt: skip
@click.option(
    '--coat', 'coats', multiple=True, metavar='NAME',
    help='Coat that a gun lays; once for each --trajectory or --atomizer, in the order of '
    'painting, the same name again for another gun of a coat. Each has dried before the next.',
)  # fmt: skip
@click.option(
    '--wet-on-wet',
    is_flag=True,
    help='All coats are one wet film: what acts on the finished film acts on their sum.',
)
@click.option(
    '--model', 'model_files', type=options.FILE, multiple=True,
    help='Deposition model, YAML, one for all guns or one for each; default: a 50 mm bell.',
)  # fmt: skip
@click.option(
    '--at', 'readings_file', type=options.FILE,
    help='Gauge readings, CSV or a workbook: also write predicted.csv, their columns and '
    'predicted_um, what the gauge should show at exactly those points: the film with effects on '
    'the gauge.',
)  # fmt: skip
@options.POINTS
@options.motion_options
@options.MAX_POSE_GAP
@options.band_options
@options.ALLOW_EFFECTS
@results_options('film.ply, film.csv, stats.json and film.png')
def simulate_command(
    part: options.Part,
    trajectories: tuple[Path, ...],
    atomizers: tuple[str, ...],
    coats: tuple[str, ...],
    wet_on_wet: bool,
    model_files: tuple[Path, ...],
    readings_file: Path | None,
    points_file: Path | None,
    motion: dict[str, Any],
    max_pose_gap_s: float,
    band: dict[str, float],
    results: Results,
) -> pd.Film:
    """Compute the film on a part from a recorded trajectory.

    film.csv and film.ply hold the film at the vertices of the refined mesh, and that of each coat.
    """
    if wet_on_wet and not coats:
        raise click.UsageError('--wet-on-wet has no --coat; name the coats, one for each motion')
    with progress('simulate') as show:
        show('loading')
        from paint_deposition.files.motion_files import read_gun_motions

        show('reading')
        source = validate(MotionOptions, 'motion', motion, pd.PaintError)
        names, motions = zip(*read_gun_motions(trajectories, source, atomizers), strict=True)
        chosen = models_for(model_files, trajectories, names)
        show('refining the mesh')
        surface, readings = part.surface(), None
        zones = part.zones()
        if readings_file:
            readings = pd.read_readings(readings_file, points_file, surface=surface)
        film = pd.simulate(
            surface, motions, [file.model for file, _ in chosen], names=names, coats=coats,
            wet_on_wet=wet_on_wet, readings=readings, max_pose_gap_s=max_pose_gap_s, zones=zones,
            strict=source.strict, progress=show, **band,
        )  # fmt: skip
        made_from = {
            **inputs(mesh_file=part.mesh, zones_file=part.zones_file),
            'trajectory': ', '.join(map(str, trajectories)),
            'model_file': ', '.join(dict.fromkeys(str(m.path) for m, _ in chosen if m.path)),
        }
        show('writing and drawing')
        results.write(film, made_from=made_from)
    notes = (*film.notes, *([readings.understood] if readings else []))
    words = '; '.join(dict.fromkeys(of_model for _, of_model in chosen))
    results.print(_film_lines(film), words, notes, film.warnings)
    return film


def _film_lines(film: pd.Film) -> Iterator[str]:
    from paint_deposition.film.statistics import paint_sentence

    s, counts = film.statistics, film.counts
    laid_cm3 = sum(gun.painted_volume_cm3 for gun in film.guns)
    for gun in film.guns:
        share = 100 * gun.painted_volume_cm3 / laid_cm3
        own = f'{gun.name}: {share:.1f} % of the paint; ' if gun.name else ''
        yield own + gun.geometry.sentence
    for coat in film.coats:
        wet_um = coat.statistics.mean_um / coat.paint.solids
        wet_film = '' if math.isnan(wet_um) else f', {wet_um:.1f} µm mean wet'
        yield _film_line(f'coat {coat.name}', coat.statistics) + wet_film
    yield _film_line('film', s)
    if not math.isnan(s.within_target):
        band = f'{s.target_um:g} ± {s.target_tolerance_um:g} µm'
        cpk = '' if s.zones else f', Cpk {s.cpk:.2f}'
        yield (
            f'{100 * s.within_target:.1f} % of it within {"its own band" if s.zones else band}, '
            f'{100 * s.below_target:.1f} % below, {100 * s.above_target:.1f} % above{cpk}'
        )
    yield from zone_lines(s.zones)
    if not math.isnan(s.capture_fraction):
        yield (
            f'{s.painted_volume_cm3:.2f} of {s.emitted_volume_cm3:.2f} cm3 on the part, '
            f'capture fraction {100 * s.capture_fraction:.0f} %'
        )
    yield from filter(None, [paint_sentence(film.paint, film.statistics)])
    yield max((gun.geometry for gun in film.guns), key=lambda of: of.facet_error).facet_sentence
    if counts.rejected or counts.gaps or counts.restarts:
        yield (
            f'{counts.rejected} of {counts.received} poses dropped, {counts.gaps} gaps taken as '
            f'gun off, {counts.restarts} restarts'
        )


def _film_line(what: str, s: FilmStatistics) -> str:
    return (
        f'{what} {s.mean_um:.1f} µm mean, {s.std_dev_um:.1f} µm standard deviation, '
        f'{s.min_um:.1f} to {s.max_um:.1f} µm on the painted {100 * s.coverage:.1f} % of '
        f'{s.area_m2:.2f} m2'
    )


@click.command('sweep')
@click.argument('sweep', type=options.FILE)
@click.option(
    '--scheduler', metavar='ADDRESS',
    help='Address of a Dask scheduler, tcp://10.0.0.5:8786; default: DASK_SCHEDULER_ADDRESS, else '
    'processes of this machine.',
)  # fmt: skip
@click.option(
    '--workers', 'count', type=click.IntRange(min=1),
    help='Processes on this machine, of one thread each; default: one a core.',
)  # fmt: skip
@options.ALLOW_EFFECTS
@results_options('cases.parquet, sweep.json and sweep.png')
def sweep_command(sweep: Path, results: Results, scheduler: str | None, count: int | None) -> None:
    """Compute the variations that SWEEP, a YAML file, describes.

    Each case is what `simulate` computes. Finished cases are kept in the folder `finished` of the
    output: a run that was cut off computes the rest only, and so does a sweep with more cases.
    """
    if scheduler and count:
        raise click.UsageError('--workers is for this machine; leave it out beside --scheduler')
    from paint_deposition.batch.sweep import sweep as computed

    with progress('sweep') as show:
        found = computed(sweep, results.output, scheduler=scheduler, count=count, progress=show)
        show('writing and drawing')
        results.write(found)
    # Each reason once, with the first of its cases.
    named: dict[str, list[int]] = {}
    for number, reason in (*found.texts('error'), *found.texts('warnings')):
        named.setdefault(reason, []).append(number)
    warnings = [
        f'case {first}{f" and {len(others)} more" if others else ""}: {reason}'
        for reason, (first, *others) in named.items()
    ]
    most = 5
    if len(warnings) > most:
        more = f'{len(warnings) - most} more in {results.output / "cases.parquet"}'
        warnings = [*warnings[:most], more]
    results.print(found.lines, notes=found.job.notes, warnings=warnings)


@click.command('locate')
@click.option(
    '--touched', required=True, type=options.FILE,
    help='Points of the part that the robot touched, in its frame: CSV with point, x, y, z.',
)  # fmt: skip
@click.option(
    '--points', required=True, type=options.FILE,
    help='The same points in the frame of the part, by the same names.',
)  # fmt: skip
@options.option_of(MotionOptions, 'pose_unit')
@options.JSON
def locate_command(touched: Path, points: Path, pose_unit: str | None, as_json: bool) -> None:
    """Find the pose of a part in the frame of the robot, to be given as --part-pose.

    From three or more named points that the robot touched.
    """
    from paint_deposition.files.atomic import json_text
    from paint_deposition.files.gauge_readings import read_points
    from paint_deposition.files.provenance import origin
    from paint_deposition.planning.part_places import locate

    given = read_points(touched, pose_unit), read_points(points, pose_unit)
    try:
        place = locate(*given)
    except RecordingError as error:
        raise RecordingError(f'{touched} and {points}: {error}') from None
    print_all('warning', place['warnings'])
    if as_json:
        files = {'touched': touched, 'points': points}
        click.echo(json_text(place | {'provenance': origin(files=files)}))
        return
    values = [f'{value + 0.0:.6g}' for value in place['part_pose']]
    click.echo(f'--part-pose {" ".join(values)}')
    click.echo(f'part_pose: [{", ".join(values)}]')
    click.echo(f'residual {place["rms_m"] * 1e3:.2f} mm RMS')
    for name, residual_m in place['residuals_m'].items():
        click.echo(f'  {name}: {residual_m * 1e3:.2f} mm')


@click.command('measure')
@options.part_options(0.01)
@click.option(
    '--trajectory', type=options.FILE,
    help='The motion, as `simulate` takes it; default: passes as `plan` would lay them, '
    'with --target-um or --speed.',
)  # fmt: skip
@options.model_option()
@options.BRUSH
@options.options_of(MeasureRequest)
@options.option_of(PlanRequest, 'speed_m_per_s')
@options.option_of(PlanRequest, 'target_um')
@options.motion_options
@options.MAX_POSE_GAP
@options.ALLOW_EFFECTS
@results_options('points.csv, poses.csv, points.png and measure.json')
def measure_command(
    request: MeasureRequest,
    part: options.Part,
    trajectory: Path | None,
    model_file: Path | None,
    brush: int,
    speed_m_per_s: float | None,
    target_um: float | None,
    motion: dict[str, Any],
    max_pose_gap_s: float,
    results: Results,
) -> None:
    """Choose where to put the gauge on a part, so that missing effects are found soonest.

    Fill the column thickness_um of points.csv and give that file as the measurements of a
    campaign.
    """
    if trajectory is None and speed_m_per_s is target_um is None:
        raise click.UsageError(
            'no motion is given; give --trajectory, or --target-um for passes '
            'as `plan` would lay them'
        )
    if trajectory is not None and (brush or speed_m_per_s or target_um):
        raise click.UsageError(
            '--target-um, --speed and --brush are of planned passes, --trajectory gives others; '
            'leave one of them out'
        )
    with progress('measure') as show:
        show('reading')
        surface = part.surface()
        warnings: tuple[str, ...] = ()
        if trajectory is None:
            file, of_model = chosen_model(model_file, brush=brush)
            recorded = pd.plan(
                surface, file.model, progress=show, speed_m_per_s=speed_m_per_s,
                target_um=target_um,
            ).trajectory  # fmt: skip
        else:
            file, of_model = model_for(model_file, trajectory)
            recorded = pd.read_recording(trajectory, **motion)
            warnings = recorded.warnings
        result = pd.choose_readings(
            surface, recorded, file.model, posterior=file.posterior,
            max_pose_gap_s=max_pose_gap_s, progress=show, **dict(request),
        )  # fmt: skip
        made_from = inputs(mesh_file=part.mesh, trajectory=trajectory, model_file=file.path)
        show('writing and drawing')
        results.write(result, made_from=made_from, part_pose=motion['part_pose'])
    results.print(_point_lines(result), of_model, result.surface.notes, warnings)


def _point_lines(result: pd.ChosenReadings) -> Iterator[str]:
    yield result.sentence
    hidden = []
    for name, chance in sorted(result.power.items(), key=lambda pair: -pair[1]):
        if chance < 0.15:  # the part hardly shows it
            hidden.append(name)
            continue
        grid = result.grid_power[name]
        yield f'{name:>22} {100 * chance:3.0f} %   on a grid {100 * grid:3.0f} %'
    if hidden:
        yield f'unlikely to be detected on this part at their typical size: {", ".join(hidden)}'
    yield (
        f'at least {result.apart_m * 1e3:.0f} mm from each other and {result.foot_m * 1e3:.0f} mm '
        f'off edges; {result.repeats} of them are to be read twice'
    )
