"""Compiled kernels on disk: found again, and never taken for one another."""

import os
import subprocess
import sys
from types import FunctionType

import numba
import pytest
from numba import njit

from paint_deposition.kernel.code_cache import named_for_its_code

FACTOR = 2.0
# Compiles a kernel with a law, or takes it from the cache, and prints which.
PAINT = """
import numba, numpy as np
from paint_deposition.kernel import eq2_flux as kernel

def law(ray, rate):
    return 1.0 - rate * ray.cos_incidence

run = kernel.compile_kernel(((law, 1),), (), False, np.float32)
one, many = np.zeros(1, np.float32), np.zeros((3, 1), np.float32)
run(many, many, np.ones(1, np.uint8), np.zeros(1), one, np.zeros((1, 0)), 0,
    np.zeros((1, 4)), np.array([0, 1]), np.zeros((1, kernel.STEP_COLUMNS), np.float32),
    np.zeros((1, 1), np.int64), np.zeros(1, np.int64), np.zeros(1, np.int64),
    np.ones((1, kernel.MODEL_CONSTANTS), np.float32), np.zeros((1, 1), np.float32))
print(sum(run.stats.cache_hits.values()))
"""


def scaling(factor):
    """A compiled function of its own for each factor, all of one name and the same byte code."""

    def scaled(x):
        return FACTOR * x

    variant = FunctionType(scaled.__code__, globals() | {'FACTOR': factor}, 'scaled')
    return njit(cache=True)(named_for_its_code(variant, [], factor))


@pytest.fixture
def empty_cache(tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, 'CACHE_DIR', str(tmp_path))
    return tmp_path


def test_variants_have_files_of_their_own_so_that_processes_cannot_swap_them(empty_cache):
    assert [scaling(factor)(10.0) for factor in (2.0, 3.0)] == [20.0, 30.0]
    assert len(list(empty_cache.rglob('*.nbi'))) == 2
    for factor in (2.0, 3.0):
        loaded = scaling(factor)
        assert loaded(10.0) == 10.0 * factor
        assert sum(loaded.stats.cache_hits.values()) == 1


@pytest.mark.slow
@pytest.mark.usefixtures('empty_cache')
def test_a_kernel_that_another_process_compiled_is_found_again():
    """Fails where a release of Numba keeps compiled code by other rules than the name."""
    here = os.environ | {'NUMBA_CACHE_DIR': numba.config.CACHE_DIR}
    for hits in (0, 1):
        found = subprocess.check_output([sys.executable, '-c', PAINT], env=here, text=True)
        assert int(found) == hits
