"""The command `view`: a recorded run in Rerun."""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import click

from paint_deposition.cli.options import FILE, python
from paint_deposition.errors import PaintError

RERUN = 'import runpy; runpy.run_module("rerun", run_name="__main__", alter_sys=True)'


@click.command('view')
@click.argument('run', type=FILE)
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
    sys.exit(subprocess.run(python(RERUN, *map(str, files))).returncode)
