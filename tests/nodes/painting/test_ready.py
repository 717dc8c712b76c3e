"""A simulator is ready soon: it loads only what it uses."""

from __future__ import annotations

import pytest

pytest.importorskip('rclpy')

import numpy as np
import trimesh

from nodes.processes import NodeProcess
from paint_deposition.files.meshes import read_mesh

# Each takes a tenth of a second or more, and none is needed to paint a part that is kept.
SLOW = ('matplotlib', 'trimesh', 'networkx')
START = f"""
import atexit, sys
from paint_deposition.nodes.executables import deposition_simulator
atexit.register(lambda: print('loaded', set({SLOW!r}) & set(sys.modules)))
sys.exit(deposition_simulator())
"""


@pytest.fixture
def part(tmp_path, monkeypatch):
    """A curved sheet of 4225 vertices, prepared and kept."""
    monkeypatch.setenv('PAINT_CACHE_DIR', str(tmp_path / 'cache'))
    across = np.linspace(-0.4, 0.4, 65)
    x, z = (axis.ravel() for axis in np.meshgrid(across, across))
    row, column = (axis.ravel() for axis in np.indices((64, 64)))
    a = 65 * row + column
    faces = np.concatenate([np.stack([a, a + 1, a + 66], 1), np.stack([a, a + 66, a + 65], 1)])
    sheet = trimesh.Trimesh(np.stack([x, 0.1 * x**2, z], axis=1), faces, process=False)
    sheet.export(tmp_path / 'part.stl')
    read_mesh(tmp_path / 'part.stl', max_edge_length_m=0.05)
    assert list((tmp_path / 'cache' / 'parts').iterdir())
    return tmp_path / 'part.stl'


def test_it_loads_nothing_that_it_does_not_use(part, ros_domain, wait_until, tmp_path):
    with NodeProcess(
        tmp_path / 'simulator', '', code=START, mesh_file=part, max_edge_length_m=0.05
    ) as simulator:
        wait_until(lambda: ': ready' in simulator.err, what='ready')
        simulator.terminate()
        assert simulator.wait() == 0, simulator.err
        assert 'loaded set()' in simulator.out
