"""The command `doctor`: what is installed, and whether it computes what it should."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from importlib import metadata
from itertools import groupby
from pathlib import Path
from textwrap import TextWrapper

import click

import paint_deposition as pd
from paint_deposition.cli.options import JSON
from paint_deposition.cli.results import python

# Mean film on the painted share of the sample panel [µm], and how far rounding may move it.
KNOWN_FILM_UM = 19.2131
ROUNDING = 1e-4
# In a process of its own: libraries of a ROS that does not fit this Python may end it.
ASK_ROS = 'import rclpy, paint_msgs.msg; print(rclpy.get_rmw_implementation_identifier())'
ROS_REMEDY = 'for nodes source ROS 2 Jazzy or newer and the built workspace, or run `make build`'
PROCESSOR_FEATURES = 'sse4.2', 'avx', 'avx2', 'fma', 'avx512f', 'neon', 'sve'


@dataclass(frozen=True)
class Finding:
    """What was looked at and found; ``ok`` is None where the films do not depend on it."""

    name: str
    found: str
    ok: bool | None = None
    remedy: str = ''


@click.command('doctor')
@JSON
def doctor_command(as_json: bool) -> None:
    """Say what is installed, and whether it computes what it should.

    The self-test paints the sample panel: its mean film is known, and a live film from the same
    poses must equal it to the last bit. Exit code 1 if something essential is missing or wrong.
    """
    findings = list(_findings())
    well = all(finding.ok is not False for finding in findings)
    if as_json:
        found = {'well': well, 'findings': [asdict(one) for one in findings]}
        click.echo(json.dumps(found, indent=2))
    else:
        lines = TextWrapper(99, subsequent_indent=' ' * 20, break_on_hyphens=False)
        for one in findings:
            mark = {True: 'ok  ', False: 'BAD ', None: '    '}[one.ok]
            heads = f'{mark}{one.name:<16}', ' ' * 17 + '-> '
            for head, words in zip(heads, (one.found, one.remedy), strict=True):
                if words:
                    click.echo(lines.fill(head + words))
        click.echo('all is well' if well else 'paint does not work as it should')
    click.get_current_context().exit(not well)


def _findings() -> Iterator[Finding]:
    """All findings; a look that fails is one, too."""
    yield Finding(
        'paint',
        f'{pd.__version__} in {Path(pd.__file__).parent}; Python {platform.python_version()}, '
        f'{platform.platform(terse=True)} {platform.machine()}',
    )
    for look in (_libraries, _ros, _processor, _rapid, _known_film):
        try:
            yield from look()
        except Exception as error:  # noqa: PERF203 (whatever a broken installation raises)
            name = look.__name__.strip('_').replace('_', ' ')
            remedy = (
                'install it again: pip install --force-reinstall ./ros2_ws/src/paint_deposition'
            )
            if 'cannot cache' in str(error):
                remedy = 'set NUMBA_CACHE_DIR to a folder that can be written'
            yield Finding(name, f'{type(error).__name__}: {error}', False, remedy)


def _libraries() -> Iterator[Finding]:
    """Versions of what the package and its extras ask for, and which are missing or too old."""
    from packaging.requirements import Requirement

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
        yield Finding(name, ', '.join(found), ok, remedy)


def _ros() -> Iterator[Finding]:
    asked = subprocess.run(python(ASK_ROS), capture_output=True, text=True, timeout=60)
    if asked.returncode:
        said = asked.stderr.strip().splitlines() or [f'ended with exit code {asked.returncode}']
        yield Finding('ROS 2', said[-1], None, ROS_REMEDY)
        return
    origin = os.environ.get('ROS_DISTRO') or 'from wheels'
    domain = os.environ.get('ROS_DOMAIN_ID', '0')
    reach = os.environ.get('ROS_AUTOMATIC_DISCOVERY_RANGE', 'SUBNET')
    yield Finding('ROS 2', f'{origin}: {asked.stdout.strip()}; domain {domain}, reach {reach}')


def _processor() -> Iterator[Finding]:
    import llvmlite.binding as llvm
    import numba

    from paint_deposition.kernel.compiler import KIND
    from paint_deposition.part.face_tree import box_distance

    has = llvm.get_host_cpu_features()
    features = ' '.join(name for name in PROCESSOR_FEATURES if has.get(name))
    threads = f'{numba.get_num_threads()} threads on {os.cpu_count()} processors'
    yield Finding('processor', f'{llvm.get_host_cpu_name()}, {features}; {threads}')
    folder = Path(box_distance.stats.cache_path)
    folder = Path(pd.__file__).parent if folder.name == '__pycache__' else folder.parent
    sizes = [file.stat().st_size for file in folder.rglob('*.nb[ic]')]
    yield Finding(
        'compiled code', f'for {KIND}: {len(sizes)} files, {sum(sizes) / 1e6:.1f} MB in {folder}'
    )


def _rapid() -> Iterator[Finding]:
    from paint_deposition.files.rapid.parser import parse_modules

    # The package lark-parser puts another lark in the place of the one that is asked for.
    parse_modules('MODULE Try\n  PROC main()\n    PaintL p1, v100;\n  ENDPROC\nENDMODULE', 'Try')
    yield Finding('RAPID', 'a program is read', True)


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
    close = abs(mean_um / KNOWN_FILM_UM - 1.0) < ROUNDING
    yield Finding('samples', str(samples))
    yield Finding('known film', words, close, '' if close else remedy)
    live = LiveFilm(film.surface.points(), pd.DepositionModel())
    live.replay(TriggerChange(*told) for told in motion.triggers)
    columns = motion.stamps_ns, motion.positions_m, motion.quaternions_xyzw
    for row in range(0, len(motion), 100):
        live.add_poses(PoseBatch(*(column[row : row + 100] for column in columns)))
    apart = int((live.snapshot().film_um != film.film_um).sum())
    words = f'live film differs from the offline film at {apart} of {len(film.film_um)} vertices'
    yield Finding('live = offline', words, not apart, remedy if apart else '')
