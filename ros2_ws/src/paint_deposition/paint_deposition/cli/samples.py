"""Commands on the samples: `demo`, from a recording to a better door; `doctor`, a self-test."""

from __future__ import annotations

import json
import os
import platform
import shlex
import subprocess
import sys
import time
import webbrowser
from collections.abc import Iterator
from importlib import metadata
from itertools import groupby
from pathlib import Path
from textwrap import TextWrapper

import click

import paint_deposition as pd
from paint_deposition.cli.options import FOLDER, JSON
from paint_deposition.cli.results import python


@click.command('demo')
@click.option(
    '-o', '--output', type=FOLDER, default=Path('paint_demo'), show_default=True,
    help='Folder for demo.html and the results that it tells of.',
)  # fmt: skip
@click.option(
    '--open/--no-open', 'opens', default=True, show_default=True,
    help='Open the page in the browser, where there is a display.',
)  # fmt: skip
def demo_command(output: Path, opens: bool) -> None:
    """Paint a sample door, find what the model lacks by its readings, plan a better door.

    These are four commands on sample files. The page that opens at the end tells it with pictures.
    """
    from paint_deposition.cli.main import paint
    from paint_deposition.report.page import write_story

    samples = pd.sample_folder() / 'measured_door'
    part = '--mesh', samples / 'door.stl'
    motion = *part, '--trajectory', samples / 'door', '--state-topic', '/atomizer/state'
    models = [output / 'diagnosis' / f'{name}.yaml' for name in ('model_before', 'model')]
    steps = {
        'film': ('simulate', *motion),
        'diagnosis': ('diagnose', samples / 'campaign.yaml'),
        'unseen': ('compare', samples / 'unseen.yaml', '--model', models[0], '--model', models[1]),
        'improved': ('improve', *motion, '--model', models[1]),
    }
    results, told = [], {}
    for folder, words in steps.items():
        given = [*map(str, words), '-o', str(output / folder)]
        told[given[0]] = f'paint {shlex.join(given)}'
        click.echo(f'$ {told[given[0]]}')
        results.append(paint.main(given, prog_name='paint', standalone_mode=False))
        click.echo()
    # What the simulator that made the samples has hidden in them: their campaign.yaml says how.
    hidden, page = 'incidence_attraction', output / 'demo.html'
    film, found, beside, improved = results
    write_story(page, film, found, beside, improved, hidden, told)
    click.echo(f'The story with pictures: {page}')
    # Where a browser has somewhere to show a page.
    desktop = sys.platform in ('darwin', 'win32')
    if opens and (desktop or any(os.environ.get(n) for n in ('DISPLAY', 'WAYLAND_DISPLAY'))):
        webbrowser.open(page.resolve().as_uri())


# Mean film on the painted share of the sample panel [µm].
KNOWN_FILM_UM = 19.2131


# What was looked at and found, whether that will do, None where the films do not depend on it, and
# the remedy.
Finding = tuple[str, str, bool | None, str]


@click.command('doctor')
@JSON
def doctor_command(as_json: bool) -> None:
    """Say what is installed, and whether it computes what it should.

    The self-test paints the sample panel: its mean film is known, and a live film from the same
    poses must equal it to the last bit. Exit code 1 if something essential is missing or wrong.
    """
    versions = (
        f'{pd.__version__} in {Path(pd.__file__).parent}; Python {platform.python_version()}, '
        f'{platform.platform(terse=True)} {platform.machine()}'
    )
    findings: list[Finding] = [('paint', versions, None, '')]
    for look in (_libraries, _ros, _processor, _known_film):
        try:
            findings += look()
        except Exception as error:  # noqa: PERF203 (whatever a broken installation raises)
            name = look.__name__.strip('_').replace('_', ' ')
            remedy = (
                'install it again: pip install --force-reinstall ./ros2_ws/src/paint_deposition'
            )
            if 'cannot cache' in str(error):
                remedy = 'set NUMBA_CACHE_DIR to a folder that can be written'
            findings.append((name, f'{type(error).__name__}: {error}', False, remedy))
    well = all(ok is not False for _, _, ok, _ in findings)
    if as_json:
        keys = ('name', 'found', 'ok', 'remedy')
        told = [dict(zip(keys, finding, strict=True)) for finding in findings]
        click.echo(json.dumps({'well': well, 'findings': told}, indent=2))
    else:
        lines = TextWrapper(99, subsequent_indent=' ' * 20, break_on_hyphens=False)
        for name, found, ok, remedy in findings:
            mark = {True: 'ok  ', False: 'BAD ', None: '    '}[ok]
            heads = f'{mark}{name:<16}', ' ' * 17 + '-> '
            for head, words in zip(heads, (found, remedy), strict=True):
                if words:
                    click.echo(lines.fill(head + words))
        click.echo('all is well' if well else 'paint does not work as it should')
    click.get_current_context().exit(not well)


def _libraries() -> Iterator[Finding]:
    """Versions of what the package and its extras ask for, and which are missing or too old."""
    from packaging.requirements import Requirement

    from paint_deposition.files.rapid.parser import parse_modules

    wanted = map(Requirement, metadata.requires('paint_deposition') or [])
    for marker, needed in groupby(wanted, lambda one: str(one.marker or '')):
        if 'test' in marker:
            continue
        found, unfit = [], []
        for one in needed:
            version = next((d.version for d in metadata.distributions(name=one.name)), 'missing')
            found.append(f'{one.name} {version}')
            if version == 'missing' or not one.specifier.contains(version, prereleases=True):
                unfit.append(f"'{one.name}{one.specifier}'")
        remedy = f'pip install {" ".join(unfit)}' if unfit else ''
        # A marker is that of an extra: extra == "many".
        name, ok = (f'extra {marker[10:-1]}', None) if marker else ('libraries', not unfit)
        yield name, ', '.join(found), ok, remedy
    # The package lark-parser puts another lark in the place of the one that is asked for.
    parse_modules('MODULE Try\n  PROC main()\n    PaintL p1, v100;\n  ENDPROC\nENDMODULE', 'Try')


def _ros() -> Iterator[Finding]:
    # In a process of its own: libraries of a ROS that does not fit this Python may end it.
    ask = 'import rclpy, paint_msgs.msg; print(rclpy.get_rmw_implementation_identifier())'
    asked = subprocess.run(python(ask), capture_output=True, text=True, timeout=60)
    if asked.returncode:
        said = asked.stderr.strip().splitlines() or [f'ended with exit code {asked.returncode}']
        remedy = (
            'for nodes source ROS 2 Jazzy or newer and the built workspace, or run `make build`'
        )
        yield 'ROS 2', said[-1], None, remedy
        return
    origin = os.environ.get('ROS_DISTRO') or 'from wheels'
    domain = os.environ.get('ROS_DOMAIN_ID', '0')
    reach = os.environ.get('ROS_AUTOMATIC_DISCOVERY_RANGE', 'SUBNET')
    found = f'{origin}: {asked.stdout.strip()}; domain {domain}, reach {reach}'
    yield 'ROS 2', found, None, ''


def _processor() -> Iterator[Finding]:
    import llvmlite.binding as llvm
    import numba

    from paint_deposition.kernel.compiler import KIND

    has = llvm.get_host_cpu_features()
    named = ('sse4.2', 'avx', 'avx2', 'fma', 'avx512f', 'neon', 'sve')
    features = ' '.join(name for name in named if has.get(name))
    threads = f'{numba.get_num_threads()} threads on {os.cpu_count()} processors'
    found = f'{llvm.get_host_cpu_name()}, {features}; {threads}; code compiled for {KIND}'
    yield 'processor', found, None, ''


def _known_film() -> Iterator[Finding]:
    from paint_deposition.film.live_film import LiveFilm
    from paint_deposition.motion.pose_stream import PoseBatch, TriggerChange

    started, samples = time.perf_counter(), pd.sample_folder()
    surface = pd.read_mesh(samples / 'panel.stl', max_edge_length_m=0.1)
    motion = pd.read_recording(samples / 'panel_577', state_topic='/atomizer/state')
    film = pd.simulate(surface, motion)
    mean_um, seconds = film.statistics.mean_um, time.perf_counter() - started
    words = f'{mean_um:.4f} µm, known {KNOWN_FILM_UM} µm, in {seconds:.1f} s'
    remedy = 'this processor or a library computes otherwise: report it with `paint doctor --json`'
    close = abs(mean_um / KNOWN_FILM_UM - 1.0) < 1e-4  # rounding moves it less
    yield 'samples', str(samples), None, ''
    yield 'known film', words, close, '' if close else remedy
    live = LiveFilm(film.surface.points(), pd.DepositionModel())
    live.replay(TriggerChange(*told) for told in motion.triggers)
    columns = motion.stamps_ns, motion.positions_m, motion.quaternions_xyzw
    for row in range(0, len(motion), 100):
        live.add_poses(PoseBatch(*(column[row : row + 100] for column in columns)))
    apart = int((live.snapshot().film_um != film.film_um).sum())
    words = f'live film differs from the offline film at {apart} of {len(film.film_um)} vertices'
    yield 'live = offline', words, not apart, remedy if apart else ''
