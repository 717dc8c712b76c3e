"""The repair of the wheels' CMake exports: right paths, once, and never through a hard link."""

import importlib.util
import sysconfig
from pathlib import Path

import pytest

HERE = f'"{sysconfig.get_path("include")};{sysconfig.get_path("purelib")}/numpy/_core/include"'


@pytest.fixture(scope='module')
def repair():
    path = Path(__file__).parents[2] / 'setup' / 'repair_cmake_exports.py'
    spec = importlib.util.spec_from_file_location('repair_cmake_exports', path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize('elsewhere', ['/opt/python/cp311-cp311', '/home/somebody/.venv'])
def test_foreign_paths_become_ours_and_relative_ones_stay(repair, elsewhere):
    foreign = (
        f'"{elsewhere}/include/python3.11;'
        f'{elsewhere}/lib/python3.11/site-packages/numpy/_core/include"'
    )
    relative = '"${_IMPORT_PREFIX}/include/python3.11;${_IMPORT_PREFIX}/lib/libpaint.so"'
    assert repair.repaired(foreign) == HERE
    for text in (HERE, relative):
        assert repair.repaired(text) == text


def test_a_hard_link_elsewhere_keeps_its_text(repair, tmp_path):
    cached, installed = tmp_path / 'cached', tmp_path / 'installed'
    cached.write_text('as built')
    installed.hardlink_to(cached)
    repair.replace(installed, 'repaired')
    assert (installed.read_text(), cached.read_text()) == ('repaired', 'as built')
    assert sorted(tmp_path.iterdir()) == [cached, installed]
