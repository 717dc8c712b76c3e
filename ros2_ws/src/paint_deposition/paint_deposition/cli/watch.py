"""The commands `watch` and `view`: a run, results or a live cell on a page in 3D, or in Rerun."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Any

import click

import paint_deposition as pd
from paint_deposition.cli import options
from paint_deposition.cli.model_choice import models_for
from paint_deposition.cli.results_folder import Progress
from paint_deposition.errors import PaintError
from paint_deposition.report.live.server import DEFAULT_HOST, DEFAULT_PORT, TOKEN, Page

if TYPE_CHECKING:
    from paint_deposition.api.replaying import Replay

NODE = 'from paint_deposition.nodes.executables import web_view; sys.exit(web_view())'
RERUN = 'import runpy; runpy.run_module("rerun", run_name="__main__", alter_sys=True)'


@click.command('watch')
@click.argument('run', type=options.FILE, required=False)
@click.option('--live', is_flag=True, help='Show what a simulator paints now; needs ROS 2.')
@options.part_options(0.01, required=False)
@options.model_option('Model that paints a run; default: that of the run, else a 50 mm bell.')
@click.option(
    '--rate', default=1.0, show_default=True, type=options.NOT_NEGATIVE,
    help='Speed of a run relative to the recording; 0: as fast as it can be painted.',
)  # fmt: skip
@click.option('--target-um', default=0.0, type=options.NOT_NEGATIVE, help='Target film [µm].')
@click.option('--tolerance-um', default=0.0, type=options.NOT_NEGATIVE,
              help='Accepted difference from the target, either way [µm].')  # fmt: skip
@click.option(
    '--host', default=DEFAULT_HOST, show_default=True,
    help='Address to listen on; any but that of this machine alone needs a token.',
)  # fmt: skip
@click.option('--port', default=DEFAULT_PORT, show_default=True, type=click.IntRange(0, 65535),
              help='Port to listen on; 0: one that is free.')  # fmt: skip
@click.option(
    '--token',
    default='',
    envvar=TOKEN,
    help=f'Token that browsers must give; default: that in the environment, {TOKEN}, or made.',
)
@options.motion_options
@options.MAX_POSE_GAP
@options.ALLOW_EFFECTS
def watch_command(
    run: Path | None,
    live: bool,
    part: dict[str, Any],
    model_file: Path | None,
    motion: dict[str, Any],
    host: str,
    port: int,
    token: str,
    **given: float,
) -> None:
    """Show RUN on a page in a browser: the part in 3D, gun, film, figures, readings.

    RUN is a recorded motion, which is painted again as it went (with the --mesh, unless the run
    names it), or a folder of results of simulate, plan, improve, compare, diagnose or refit.
    """
    if live == (run is not None):
        raise click.UsageError('give RUN, or --live for what a simulator paints now')
    if given['tolerance_um'] and not given['target_um']:
        raise click.UsageError('--tolerance-um has no --target-um; give both')
    if live and not part['path']:
        raise click.UsageError("--live needs the mesh of the simulator's part; give --mesh")
    at: dict[str, Any] = {'host': host, 'port': port, 'token': token}
    if live:
        _start_node({
            'mesh_file': part['path'], 'mesh_scale': part['scale'],
            'max_edge_length_m': part['max_edge_length_m'], 'target_um': given['target_um'],
            'target_tolerance_um': given['tolerance_um'], 'host': host, 'port': port,
        }, token)  # fmt: skip
    assert run is not None
    with Progress('watch') as show:
        show('loading')
        from paint_deposition.api.shown_results import is_results, results_scenes

        if is_results(run):
            show('painting the parts')
            scenes, warnings = results_scenes(run)
            serve = Page(scenes, **at), lambda stop: stop.wait()
        else:
            replay = _replay(show, run, part, model_file, motion, given)
            warnings = list(replay.warnings)
            serve = Page([replay.scene], **at, command=replay.command), replay.run
    options.print_all('warning', warnings)
    _serve(*serve)


def _replay(
    show: Progress, run: Path, part: dict[str, Any], model_file: Path | None,
    motion: dict[str, Any], given: dict[str, float],
) -> Replay:  # fmt: skip
    from paint_deposition.api.replaying import Replay
    from paint_deposition.files.motion_files import read_gun_motions
    from paint_deposition.files.motion_source import MotionSource
    from paint_deposition.files.recordings.bag_files import custom_data, open_bag
    from paint_deposition.files.recordings.bags import STATE_TOPIC
    from paint_deposition.request import validate

    show('reading')
    if not run.exists():
        raise click.UsageError(f'{run} is not there; give a recorded run or a folder of results')
    recorded = custom_data(run)
    if recorded and not motion['state_topic']:
        with open_bag(run) as bag:
            motion['state_topic'] = STATE_TOPIC if bag.find(STATE_TOPIC) else None
    mesh = part['path'] or recorded.get('mesh_file')
    if not mesh:
        raise click.UsageError(f'{run} does not name the mesh of its part; give --mesh')
    named = Path(recorded['model_file']) if recorded.get('model_file') else None
    source = validate(MotionSource, 'motion', motion, pd.PaintError)
    guns = read_gun_motions([run], source)
    files = [file for file in (model_file or named,) if file]
    chosen = models_for(files, [run], [gun.name for gun in guns], named=model_file is not None)
    show('refining the mesh')
    surface = pd.read_mesh(**part | {'path': Path(mesh)})
    replay = Replay(surface, guns, [model.model for model in chosen], **given)
    replay.scene.tell('about', text=f'{run.name} on {Path(mesh).name}')
    return replay


def _serve(page: Page, work: Callable[[Event], object]) -> None:
    """Keep the page until Ctrl-C."""
    click.echo(f'{page.url}  (Ctrl-C ends it)')
    stop = Event()
    try:
        work(stop)
    except KeyboardInterrupt:
        stop.set()
    finally:
        page.close()


def _start_node(parameters: dict[str, object], token: str) -> None:
    """Become the node `web_view`, which says what it needs; others can read its words."""
    os.environ[TOKEN] = token
    words = [w for name, value in parameters.items() if value not in ('', None)
             for w in ('-p', f'{name}:={value}')]  # fmt: skip
    command = options.python(NODE, '--ros-args', *words)
    os.execv(command[0], command)


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
    sys.exit(subprocess.run(options.python(RERUN, *map(str, files))).returncode)
