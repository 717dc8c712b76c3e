"""Compiled kernels on disk: found again, and never taken for one another."""

import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import FunctionType

import numba
import pytest
from numba import njit

import paint_deposition
from paint_deposition.kernel.compiler import named_for_its_code

FACTOR = 2.0


def scaling(factor):
    """A compiled function of its own for each factor, all of one name and the same byte code."""

    def scaled(x):
        return FACTOR * x

    variant = FunctionType(scaled.__code__, globals() | {'FACTOR': factor}, 'scaled')
    return njit(cache=True)(named_for_its_code(variant, [], factor))


def test_variants_have_files_of_their_own_so_that_processes_cannot_swap_them(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(numba.config, 'CACHE_DIR', str(tmp_path))
    assert [scaling(factor)(10.0) for factor in (2.0, 3.0)] == [20.0, 30.0]
    assert len(list(tmp_path.rglob('*.nbi'))) == 2
    for factor in (2.0, 3.0):
        loaded = scaling(factor)
        assert loaded(10.0) == 10.0 * factor
        assert sum(loaded.stats.cache_hits.values()) == 1


# The name of a function that uses NumPy, and how often compiled code of another was found on disk;
# the file given stands for that of another NumPy.
LOOK_ON_DISK = """
import sys
import numpy as np
np.__file__ = sys.argv[1]
from paint_deposition.part.face_tree import _find
from paint_deposition.part.face_tree import box_distance

box_distance(np.zeros(3), np.zeros(11))
print(_find.py_func.__qualname__, *box_distance.stats.cache_hits.values())
"""


@pytest.mark.slow
def test_code_that_a_wheel_brings_is_found_in_another_place_and_with_another_numpy(tmp_path):
    """In a copy of the package elsewhere, with files of another time."""
    package = Path(paint_deposition.__file__).parent
    numpy_file, told = Path(__file__), []
    for folder, source in (('first', package), ('second', tmp_path / 'first/paint_deposition')):
        compiled = ['*.nb[ic]'] if folder == 'first' else []
        ignore = shutil.ignore_patterns('*.pyc', 'static', *compiled)
        copy = shutil.copytree(source, tmp_path / folder / source.name, ignore=ignore)
        for file in copy.rglob('*.py'):
            os.utime(file, (1e9, 1e9))
        environment = os.environ | {'PYTHONPATH': str(copy.parent)}
        environment.pop('NUMBA_CACHE_DIR', None)
        command = [sys.executable, '-c', LOOK_ON_DISK, numpy_file]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        told.append(done.stdout.split())
        numpy_file = package / 'errors.py'
    assert told[1] == [*told[0], '1']
