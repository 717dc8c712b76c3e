"""A user's own effect edited between runs: every run computes what the file says now."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

HELPERS = """
from numba import njit

@njit
def raised(x):
    return x + {lift}
"""
EFFECT = """
# {comment}
from numba import njit
from raising import raised
from paint_deposition.effects.base import Effect, Ray, parameter

GAIN = {gain}

@njit
def helper(x):
    return {helped} * x

class Scaled(Effect):
    id = 'scaled'
    family = 'own'
    a: float = parameter(0.0, low=0.0, high=1.0, typical=0.5, unit='1', description='a')

    @staticmethod
    def flux_factor(ray: Ray, a: float) -> float:
        return 1.0 + GAIN * helper(raised(a) - a)
"""
# One run: the film with the effect over the film without.
RUN = """
import json
import sys

import numpy as np

from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.effects.user_effects import load_effect_file
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.part.points import SurfacePoints

motion = Trajectory(
    np.array([0, 10_000_000]), np.array([[0.2, 0.0, 0.25]] * 2), np.tile([1.0, 0, 0, 0], (2, 1))
)

def film_um(model):
    points = SurfacePoints(np.zeros((8, 3)), np.tile([0.0, 0.0, 1.0], (8, 1)))
    integrator = FilmIntegrator(points, model, 'double')
    integrator.add(spray_path(motion)[0])
    return integrator.film_um[0]

effect = load_effect_file(sys.argv[1])
plain = DepositionModel()
print(json.dumps(film_um(plain.with_effect(effect(a=0.5))) / film_um(plain)))
"""


@pytest.fixture
def run(tmp_path: Path, monkeypatch):
    """Writes the effect, films with it in a process of its own, returns the factor on the film."""
    sources = Path(__file__).resolve().parents[2] / 'ros2_ws/src/paint_deposition'
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path / 'compiled'))
    paths = [str(sources), str(tmp_path), os.environ.get('PYTHONPATH', '')]
    monkeypatch.setenv('PYTHONPATH', os.pathsep.join(paths))

    def write_and_film(**changes: object) -> float:
        values = {'comment': 'one', 'gain': 2.0, 'helped': 3.0, 'lift': 0.25}
        values |= changes
        (tmp_path / 'raising.py').write_text(HELPERS.format(**values))
        (tmp_path / 'own.py').write_text(EFFECT.format(**values))
        done = subprocess.run(
            [sys.executable, '-B', '-c', RUN, str(tmp_path / 'own.py')],
            capture_output=True, text=True, timeout=100, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    return write_and_film


def test_what_is_edited_between_runs_counts_in_the_next(run):
    assert run() == pytest.approx(1.0 + 2.0 * 3.0 * 0.25)
    assert run(comment='two') == pytest.approx(1.0 + 2.0 * 3.0 * 0.25)
    assert run(gain=4.0) == pytest.approx(1.0 + 4.0 * 3.0 * 0.25)
    assert run(helped=5.0) == pytest.approx(1.0 + 2.0 * 5.0 * 0.25)
    # In a file of its own that the effect's file imports.
    assert run(lift=0.75) == pytest.approx(1.0 + 2.0 * 3.0 * 0.75)
    # As it was first: found on disk.
    assert run() == pytest.approx(1.0 + 2.0 * 3.0 * 0.25)
