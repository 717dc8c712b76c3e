"""The commands `simulate` and `sweep`: the film on a part, and that of many variations."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import paint_deposition as pd
from paint_deposition.cli import options
from paint_deposition.cli.model_choice import models_for
from paint_deposition.cli.results_folder import Progress

if TYPE_CHECKING:
    from paint_deposition.film.statistics import FilmStatistics


@click.command('simulate')
@options.part_options(0.01)
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
@click.option('--target-um', default=0.0, type=options.NOT_NEGATIVE, help='Target film [µm].')
@click.option('--tolerance-um', default=0.0, type=options.NOT_NEGATIVE,
              help='Accepted difference from the target, either way [µm].')  # fmt: skip
@options.ZONES
@options.ALLOW_EFFECTS
@options.results_options('film.ply, film.csv, stats.json and film.png')
def simulate_command(
    part: dict[str, Any],
    trajectories: tuple[Path, ...],
    atomizers: tuple[str, ...],
    coats: tuple[str, ...],
    wet_on_wet: bool,
    model_files: tuple[Path, ...],
    readings_file: Path | None,
    points_file: Path | None,
    motion: dict[str, Any],
    zones_file: Path | None,
    results: options.Results,
    **wanted: float,
) -> None:
    """Compute the film on a part from a recorded trajectory.

    film.csv and film.ply hold the film at the vertices of the refined mesh, and that of each coat.
    """
    if wet_on_wet and not coats:
        raise click.UsageError('--wet-on-wet has no --coat; name the coats, one for each motion')
    if wanted['tolerance_um'] and not wanted['target_um']:
        raise click.UsageError('--tolerance-um has no --target-um; give both')
    with Progress('simulate') as show:
        show('loading')
        from paint_deposition.files.motion_files import read_gun_motions
        from paint_deposition.files.motion_source import MotionSource
        from paint_deposition.request import validate

        show('reading')
        source = validate(MotionSource, 'motion', motion, pd.PaintError)
        guns = read_gun_motions(trajectories, source, atomizers)
        chosen = models_for(model_files, trajectories, [gun.name for gun in guns])
        show('refining the mesh')
        surface = pd.read_mesh(**part)
        zones = options.zones_of(zones_file, part)
        readings = None
        if readings_file:
            readings = pd.read_readings(readings_file, points_file, surface=surface)
        film = pd.simulate(
            surface, [gun.trajectory for gun in guns], [model.model for model in chosen],
            names=[gun.name for gun in guns], coats=coats, wet_on_wet=wet_on_wet,
            readings=readings, zones=zones, strict=source.strict, progress=show, **wanted,
        )  # fmt: skip
        made_from = {
            'mesh_file': str(part['path']),
            'trajectory': ', '.join(map(str, trajectories)),
            'zones_file': str(zones_file or ''),
            'model_file': ', '.join(dict.fromkeys(str(m.path) for m in chosen if m.path)),
        }
        show('writing and drawing')
        results.write(film, made_from=made_from)
    options.print_all('note', film.notes)
    options.print_all('note', [readings.understood] if readings else [])
    options.print_all('warning', film.warnings)
    words = '; '.join(dict.fromkeys(model.words for model in chosen))
    results.print(_lines(film), model=words)


def _film_line(what: str, s: FilmStatistics) -> str:
    return (
        f'{what} {s.mean_um:.1f} µm mean, {s.std_dev_um:.1f} µm standard deviation, '
        f'{s.min_um:.1f} to {s.max_um:.1f} µm on the painted {100 * s.coverage:.1f} % of '
        f'{s.area_m2:.2f} m2'
    )


def _lines(film: pd.Film) -> Iterator[str]:
    s, counts = film.statistics, film.counts
    laid_cm3 = sum(gun.painted_volume_cm3 for gun in film.guns)
    for gun in film.guns:
        if gun.name:
            share = gun.painted_volume_cm3 / laid_cm3
            yield f'{gun.name}: {100 * share:.1f} % of the paint; {gun.geometry.sentence}'
        else:
            yield gun.geometry.sentence
    for coat in film.coats:
        wet_film = '' if math.isnan(coat.mean_wet_um) else f', {coat.mean_wet_um:.1f} µm mean wet'
        yield _film_line(f'coat {coat.name}', coat.statistics) + wet_film
    yield _film_line('film', s)
    if s.has_target:
        band = f'{s.target_um:g} ± {s.target_tolerance_um:g} µm'
        cpk = '' if s.zones else f', Cpk {s.cpk:.2f}'
        yield (
            f'{100 * s.within_target:.1f} % of it within {"its own band" if s.zones else band}, '
            f'{100 * s.below_target:.1f} % below, {100 * s.above_target:.1f} % above{cpk}'
        )
    yield from options.zone_lines(s.zones)
    if not math.isnan(s.capture_fraction):
        yield (
            f'{s.painted_volume_cm3:.2f} of {s.emitted_volume_cm3:.2f} cm3 on the part, '
            f'capture fraction {100 * s.capture_fraction:.0f} %'
        )
    yield from options.paint_lines(film)
    coarsest = max(film.guns, key=lambda gun: gun.geometry.facet_error)
    yield coarsest.geometry.facet_sentence
    if counts.rejected or counts.gaps or counts.restarts:
        yield (
            f'{counts.rejected} of {counts.received} poses dropped, {counts.gaps} gaps taken as '
            f'gun off, {counts.restarts} restarts'
        )


MOST_WARNINGS = 5


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
@options.results_options('cases.parquet, sweep.json and sweep.png')
def sweep_command(
    sweep: Path, results: options.Results, scheduler: str | None, count: int | None
) -> None:
    """Compute the variations that SWEEP, a YAML file, describes.

    Each case is what `simulate` computes. Finished cases are kept in the folder `finished` of the
    output: a run that was cut off computes the rest only, and so does a sweep with more cases.
    """
    if scheduler and count:
        raise click.UsageError('--workers is for this machine; leave it out beside --scheduler')
    from paint_deposition.batch.sweep import sweep as computed

    with Progress('sweep') as show:
        found = computed(sweep, results.output, scheduler=scheduler, count=count, progress=show)
        show('writing and drawing')
        results.write(found)
    options.print_all('note', found.job.notes)
    odd = ((f'case {number}', line) for number, line in (*found.errors, *found.warnings))
    _print_warnings(odd, results.output / 'cases.parquet')
    results.print(found.lines)


def _print_warnings(warnings: Iterable[tuple[str, str]], file: Path) -> None:
    """Print some of many warnings (name, reason), each reason once, and the file of all."""
    named: dict[str, list[str]] = {}
    for name, reason in warnings:
        named.setdefault(reason, []).append(name)
    lines = [
        f'{first}{f" and {len(others)} more" if others else ""}: {reason}'
        for reason, (first, *others) in named.items()
    ]
    options.print_all('warning', lines[:MOST_WARNINGS])
    if len(lines) > MOST_WARNINGS:
        options.print_all('warning', [f'{len(lines) - MOST_WARNINGS} more in {file}'])
