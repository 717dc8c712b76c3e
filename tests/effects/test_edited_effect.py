"""A user's own effect edited between runs: every run computes what the file says now."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

IMPORTED = """
from numba import njit

@njit
def raised(x):
    return x + {lift}
"""
EFFECT = """
from raising import raised
from paint_deposition.effects.base import Effect, Ray, parameter

GAIN = {gain}

class Scaled(Effect):
    id = 'scaled'
    family = 'own'
    a: float = parameter(0.0, low=0.0, high=1.0, typical=0.5, unit='1', description='a')

    @staticmethod
    def flux_factor(ray: Ray, a: float) -> float:
        return 1.0 + GAIN * (raised(a) - a)
"""
# One run: the law, compiled and kept on disk as a kernel is, and how often it was found there.
RUN = """
import sys

from paint_deposition.effects.base import Ray
from paint_deposition.effects.catalogue import load_effect_file
from paint_deposition.kernel.compiler import named_for_its_code, njit
from paint_deposition.kernel.laws import product

law = load_effect_file(sys.argv[1]).flux_factor
factor = product([(law, 1)], float)

def scaled(ray, parameters):
    return factor(ray, parameters)

compiled = njit(cache=True)(named_for_its_code(scaled, [law]))
print(compiled(Ray(0.1, 0.2, 1.7, 0.6, 0.4), (0.5,)))
print(sum(compiled.stats.cache_hits.values()))
"""


@pytest.fixture
def run(tmp_path: Path):
    """Writes the effect, runs its law in a new process; returns the factor and the cache hits."""
    (tmp_path / 'run.py').write_text(RUN)
    environment = {k: v for k, v in os.environ.items() if k != 'NUMBA_CACHE_DIR'}

    def write_and_run(**changes: float) -> tuple[float, int]:
        values = {'gain': 2.0, 'lift': 0.25} | changes
        (tmp_path / 'raising.py').write_text(IMPORTED.format(**values))
        (tmp_path / 'own.py').write_text(EFFECT.format(**values))
        done = subprocess.run(
            [sys.executable, '-B', tmp_path / 'run.py', tmp_path / 'own.py'],
            capture_output=True, text=True, check=False, env=environment,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        factor, hits = done.stdout.split()
        return float(factor), int(hits)

    return write_and_run


@pytest.mark.slow
def test_what_is_edited_between_runs_counts_in_the_next_and_what_is_not_is_found_again(run):
    """Also where a release of Numba keeps compiled code by other rules than the name."""
    assert run() == (pytest.approx(1.0 + 2.0 * 0.25), 0)
    assert run() == (pytest.approx(1.0 + 2.0 * 0.25), 1)
    # In a file of its own that the effect's file imports.
    assert run(lift=0.75) == (pytest.approx(1.0 + 2.0 * 0.75), 0)
