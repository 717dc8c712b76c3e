"""A user's own effect edited between runs: every run computes what the file says now."""

import os
import subprocess
import sys

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

GAIN = 2.0

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


@pytest.mark.slow
def test_what_is_edited_between_runs_counts_in_the_next_and_what_is_not_is_found_again(tmp_path):
    """Also in a file that the effect's file imports, whatever Numba goes by."""
    (tmp_path / 'run.py').write_text(RUN)
    (tmp_path / 'own.py').write_text(EFFECT)
    environment = {k: v for k, v in os.environ.items() if k != 'NUMBA_CACHE_DIR'}
    for lift, hits in ((0.25, 0), (0.25, 1), (0.75, 0)):
        (tmp_path / 'raising.py').write_text(IMPORTED.format(lift=lift))
        command = [sys.executable, '-B', tmp_path / 'run.py', tmp_path / 'own.py']
        done = subprocess.run(command, capture_output=True, text=True, env=environment)
        assert done.returncode == 0, done.stderr
        factor, found = done.stdout.split()
        assert float(factor) == pytest.approx(1.0 + 2.0 * lift)
        assert int(found) == hits
