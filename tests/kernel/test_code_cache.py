"""Compiled kernels on disk: found again, and never taken for one another."""

from types import FunctionType

import numba
import pytest
from numba import njit

from paint_deposition.kernel.code_cache import named_for_its_code

FACTOR = 2.0


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
