"""Compiled kernels on disk: found again, and never taken for one another."""

import numba
import pytest
from numba import njit
from numba.core.caching import IndexDataCacheFile

from paint_deposition.kernel.code_cache import identity, kept_on_disk

RATE = 2.0


def law(ray, rate):
    return 1.0 - rate * ray.cos_incidence


def law_with_another_number(ray, rate):
    return 1.5 - rate * ray.cos_incidence


def law_that_names_a_number(ray, rate):
    return RATE - rate * ray.cos_incidence


def test_the_name_covers_code_numbers_and_variant(monkeypatch):
    names = [
        identity([]),
        identity([law]),
        identity([law_with_another_number]),
        identity([law_that_names_a_number]),
        identity([law, law_with_another_number]),
        identity([law], True),
        identity([law], False),
    ]
    assert len(set(names)) == len(names)
    assert identity([law], True) == names[5]
    before = identity([law_that_names_a_number])
    monkeypatch.setitem(globals(), 'RATE', 3.0)
    assert identity([law_that_names_a_number]) != before


def calling(called):
    @njit
    def caller(x):
        return called(x) + 1.0

    return caller.py_func


def test_the_name_covers_compiled_functions_that_are_called():
    doubled, tripled = njit(lambda x: 2.0 * x), njit(lambda x: 3.0 * x)
    assert identity([calling(doubled)]) == identity([calling(doubled)])
    assert identity([calling(doubled)]) != identity([calling(tripled)])


def scaling(factor):
    """A compiled function of its own for each factor, all of one name."""

    @njit
    def scaled(x):
        return factor * x

    return kept_on_disk(scaled, [], factor)


@pytest.fixture
def empty_cache(tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, 'CACHE_DIR', str(tmp_path))


@pytest.mark.usefixtures('empty_cache')
def test_compiled_code_is_found_again():
    assert scaling(2.0)(10.0) == 20.0
    again = scaling(2.0)
    assert again(10.0) == 20.0
    assert sum(again.stats.cache_hits.values()) == 1


@pytest.mark.usefixtures('empty_cache')
def test_processes_that_compile_at_once_do_not_swap_their_code(monkeypatch):
    with monkeypatch.context() as at_once:
        # As it is for each of two processes that have not seen what the other saves.
        at_once.setattr(IndexDataCacheFile, '_load_index', lambda self: {})
        assert [scaling(factor)(10.0) for factor in (2.0, 3.0)] == [20.0, 30.0]
    for factor in (2.0, 3.0):
        loaded = scaling(factor)
        assert loaded(10.0) == 10.0 * factor
        assert sum(loaded.stats.cache_hits.values()) == 1
