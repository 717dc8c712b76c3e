"""The command `paint`, in this process as a rule and as a process where that is the point.

Figures that a command prints as JSON are held against `cli/outputs.py` every time.
"""

import csv
import io
import json
import subprocess
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from booth import LOOKING_ALONG_Y
from cli.outputs import ANY, OUTPUTS
from paint_deposition.cli.main import run
from paint_deposition.motion.trajectory import Trajectory
from scenes import straight_pass
from surfaces import on_grid

TRIGGER = ('--state-topic', '/atomizer/state')
COARSE = ('--max-edge-length-m', 0.05)
# A model of three brushes.
BRUSHES = """
brushes:
  1: {planar: {K1_cm3_per_s: 0.7, r_m: 0.1, sigma1_m: 0.06}, flow_cm3_per_min: 200, solids: 0.4,
      bell_speed_rpm: 30000, density_g_per_cm3: 1.1}
  2: {planar: {K1_cm3_per_s: 1.4, r_m: 0.2, sigma1_m: 0.08}, flow_cm3_per_min: 400, solids: 0.4,
      bell_speed_rpm: 50000, density_g_per_cm3: 1.1}
  3: {planar: {K1_cm3_per_s: 1.0, r_m: 0.15, sigma1_m: 0.07}, flow_cm3_per_min: 300, solids: 0.4,
      bell_speed_rpm: 40000, density_g_per_cm3: 1.1}
"""


def checked(done: subprocess.CompletedProcess, words: list[str]) -> subprocess.CompletedProcess:
    """The same, its JSON valid if it printed any."""
    if '--json' in words and done.returncode == 0:
        OUTPUTS.get(words[0], ANY).model_validate_json(done.stdout)
    return done


def paint(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess:
    """Run `paint` with these arguments in this process: all but its start and its end."""
    words = [str(argument) for argument in arguments]
    output, errors = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as place, redirect_stdout(output), redirect_stderr(errors):
        place.chdir(cwd or Path.cwd())
        code = run(words)
    done = subprocess.CompletedProcess(words, code, output.getvalue(), errors.getvalue())
    return checked(done, words)


def ran(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess:
    """Run `paint`, which must succeed."""
    done = paint(*arguments, cwd=cwd)
    assert done.returncode == 0, done.stderr
    return done


def figures_of(*arguments: object, cwd: Path | None = None) -> Any:
    """The figures that `paint` prints as JSON."""
    return json.loads(ran(*arguments, cwd=cwd).stdout)


def told_in(path: Path) -> Any:
    """The figures that a command wrote."""
    return json.loads(path.read_text())


def assert_refused(done: subprocess.CompletedProcess, *words: str) -> None:
    """Exit code 2, nothing on stdout, one line on stderr with these words in it."""
    assert done.returncode == 2, done.stderr
    assert done.stdout == ''
    lines = done.stderr.splitlines()
    assert len(lines) == 1, done.stderr
    assert lines[0].startswith('paint: ')
    for word in words:
        assert word in lines[0], lines[0]


def level_pass(**changes) -> Trajectory:
    """One pass of 3 s over the panel, 0.25 m before it."""
    line = (np.arange(0.0, 3.0, 0.02), (-0.5, -0.25, 0.05), (0.5, -0.25, -0.05), LOOKING_ALONG_Y)
    return straight_pass(*line, **changes)


def film_in(folder: Path) -> np.ndarray:
    """The film of a folder of results [um]."""
    return np.genfromtxt(folder / 'film.csv', delimiter=',', names=True)['thickness_um']


def rows_of(path: Path) -> list[dict[str, str]]:
    """The rows of a table, by its headings."""
    with path.open(newline='') as file:
        return list(csv.DictReader(file))


def sheet(x: np.ndarray, y: np.ndarray, z: np.ndarray, path):
    """Write a sheet over a grid (I, J) of points that looks to -y."""
    trimesh.Trimesh(*on_grid(np.stack([x, y, z], axis=2)), process=False).export(path)
    return path
