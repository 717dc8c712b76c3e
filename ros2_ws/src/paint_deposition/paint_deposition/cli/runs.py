"""Commands on recorded runs: `watch` also the live cell, `view`, `recover`."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Any

import click

import paint_deposition as pd
from paint_deposition.cli import options
from paint_deposition.cli.models import models_for
from paint_deposition.cli.results import SHOW_PROGRESS_AFTER_S, Show, print_all, progress, python
from paint_deposition.errors import PaintError
from paint_deposition.report.live_page import DEFAULT_HOST, DEFAULT_PORT, TOKEN, Page
from paint_deposition.request import MotionOptions, validate

if TYPE_CHECKING:
    from paint_deposition.api.replaying import Replay

# Options of `watch` that say how a cell is shown live; all others are of a recorded run.
OF_LIVE = (
    'live', 'mesh', 'mesh_scale', 'max_edge_length_m', 'down', 'target_um', 'tolerance_um', 'host',
    'port', 'token',
)  # fmt: skip


@click.command('watch')
@click.argument('run', type=options.FILE, required=False)
@click.option('--live', is_flag=True, help='Show what a simulator paints now; needs ROS 2.')
@options.part_options(0.01, required=False)
@options.model_option('Model that paints a run; default: that of the run, else a 50 mm bell.')
@click.option(
    '--rate', default=1.0, show_default=True, type=options.NOT_NEGATIVE,
    help='Speed of a run relative to the recording; 0: as fast as it can be painted.',
)  # fmt: skip
@options.band_options
@click.option(
    '--host', default=DEFAULT_HOST, show_default=True,
    help='Address to listen on; any but that of this machine alone needs a token.',
)  # fmt: skip
@click.option('--port', default=DEFAULT_PORT, show_default=True, type=click.IntRange(0, 65535),
              help='Port to listen on; 0: one that is free.')  # fmt: skip
@click.option(
    '--token', default='', envvar=TOKEN,
    help=f'Token that browsers must give; default: that in the environment, {TOKEN}, or made.',
)  # fmt: skip
@options.motion_options
@options.MAX_POSE_GAP
@options.ALLOW_EFFECTS
def watch_command(
    run: Path | None,
    live: bool,
    part: options.Part,
    model_file: Path | None,
    motion: dict[str, Any],
    band: dict[str, float],
    host: str,
    port: int,
    token: str,
    **pace: float,
) -> None:
    """Show RUN on a page in a browser: the part in 3D, gun, film, figures.

    RUN is a recorded motion, which is painted again as it went (with the --mesh, unless the run
    names it).
    """
    if live == (run is not None):
        raise click.UsageError('give RUN, or --live for what a simulator paints now')
    if live and not part.mesh:
        raise click.UsageError("--live needs the mesh of the simulator's part; give --mesh")
    if run is None:
        if others := options.given_beside(*OF_LIVE):
            raise click.UsageError(f'{others[0]} is for a recorded RUN, not for --live')
        values = {
            'mesh_file': part.mesh, 'mesh_scale': part.mesh_scale,
            'max_edge_length_m': part.max_edge_length_m, 'target_um': band['target_um'],
            'target_tolerance_um': band['tolerance_um'], 'host': host, 'port': port,
            'down': None if part.down is None else list(part.down),
        }  # fmt: skip
        # This process becomes the node, which says what it needs; others can read its words.
        os.environ[TOKEN] = token
        given = (f'{name}:={value}' for name, value in values.items() if value not in ('', None))
        node = 'from paint_deposition.nodes.executables import web_view; sys.exit(web_view())'
        command = python(node, '--ros-args', *(word for value in given for word in ('-p', value)))
        os.execv(command[0], command)
    with progress('watch') as show:
        replay = _replay(show, run, part, model_file, motion, {**band, **pace})
        page = Page(replay.scene, host, port, token, replay.command)
    print_all('warning', replay.warnings)
    click.echo(f'{page.url}  (Ctrl-C ends it)')
    stop = Event()
    try:
        replay.run(stop)
    except KeyboardInterrupt:
        stop.set()
    finally:
        page.close()


def _replay(
    show: Show, run: Path, part: options.Part, model_file: Path | None,
    motion: dict[str, Any], given: dict[str, float],
) -> Replay:  # fmt: skip
    show('loading')
    from paint_deposition.api.replaying import Replay
    from paint_deposition.files.motion_files import read_gun_motions
    from paint_deposition.files.recordings.bag_files import custom_data, open_bag
    from paint_deposition.files.recordings.bags import STATE_TOPIC

    show('reading')
    if not run.exists():
        raise click.UsageError(f'{run} is not there; give a recorded run')
    recorded = custom_data(run)
    if recorded and not motion['state_topic']:
        with open_bag(run) as bag:
            motion['state_topic'] = STATE_TOPIC if bag.find(STATE_TOPIC) else None
    mesh = part.mesh or recorded.get('mesh_file')
    if not mesh:
        raise click.UsageError(f'{run} does not name the mesh of its part; give --mesh')
    named = Path(recorded['model_file']) if recorded.get('model_file') else None
    guns = read_gun_motions([run], validate(MotionOptions, 'motion', motion, pd.PaintError))
    files = [file for file in (model_file or named,) if file]
    chosen = models_for(files, [run], [name for name, _ in guns], named=model_file is not None)
    show('refining the mesh')
    surface = part.surface(Path(mesh))
    replay = Replay(surface, guns, [file.model for file, _ in chosen], **given)
    replay.scene.tell('about', text=f'{run.name} on {Path(mesh).name}')
    return replay


@click.command('view')
@click.argument('run', type=options.FILE)
def view_command(run: Path) -> None:
    """Open RUN, a recorded run or one of its .mcap files, in Rerun.

    Rerun shows poses, states and the cloud of the film over time. `paint watch` needs nothing
    else and shows the film itself.
    """
    files = sorted(run.glob('*.mcap')) if run.is_dir() else [run]
    if not files or any(file.suffix != '.mcap' for file in files):
        raise PaintError(f'{run}: no .mcap file; give a run that run_recorder recorded')
    if find_spec('rerun') is None:
        raise PaintError('Rerun is not installed; run: pip install rerun-sdk')
    rerun = 'import runpy; runpy.run_module("rerun", run_name="__main__", alter_sys=True)'
    sys.exit(subprocess.run(python(rerun, *map(str, files))).returncode)


@click.command('recover')
@click.argument('run', type=options.FILE)
@click.option(
    '-o', '--output', type=options.FILE,
    help='Folder to make; default: RUN with _recovered behind its name.',
)  # fmt: skip
@options.JSON
def recover_command(run: Path, output: Path | None, as_json: bool) -> None:
    """Make a whole rosbag2 folder of what can be read of RUN, an unfinished or damaged MCAP run.

    RUN is a run's folder or its .mcap file.
    """
    from tqdm import tqdm

    from paint_deposition.files.atomic import json_text
    from paint_deposition.files.provenance import origin
    from paint_deposition.files.recordings.bag_files import mcap_files
    from paint_deposition.files.recordings.mcap_recovery import recover

    output = output or run.with_name(f'{run.stem if run.is_file() else run.name}_recovered')
    size = sum(file.stat().st_size for file in mcap_files(run))
    with tqdm(
        total=size, unit='B', unit_scale=True, desc='recover', delay=SHOW_PROGRESS_AFTER_S,
        disable=None,
    ) as bar:  # fmt: skip
        found, lost = recover(run, output, on_bytes=bar.update)
    figures = {
        'folder': str(found.folder), 'messages': found.message_count, 'topics': found.counts,
        **lost, 'provenance': origin(files={'recording': run}),
    }  # fmt: skip
    lines = [*lost['breaks']]
    if count := lost['damaged_chunks']:
        lines.append(f'{count} damaged chunks left out')
    if topics := lost['skipped_topics']:
        lines.append(f'left out, not CDR or without a schema: {" ".join(topics)}')
    lines += [f'{count:10d}  {topic}' for topic, count in found.counts.items()]
    lines.append(f'{found.message_count} messages recovered: {found.folder}')
    click.echo(json_text(figures) if as_json else '\n'.join(lines))
