"""The sample parts are what the documentation says they are."""

import subprocess
import sys

import numpy as np
import pytest

from booth import SAMPLES
from paint_deposition.files.meshes import read_mesh


@pytest.fixture(scope='module')
def door():
    return read_mesh(SAMPLES / 'door.stl')


def test_the_door_has_its_convex_line_and_its_concave_third(door):
    z = np.linspace(0.02, 0.85, 167)
    section = door.at(np.stack([0 * z, 0 * z, z], axis=1)).curvature_per_m
    assert 0.43 < z[section.argmin()] < 0.53
    assert section.min() < -3.0
    assert 0.1 < z[section.argmax()] < 0.3
    assert section.max() > 3.0
    assert np.abs(section[z > 0.6]).max() < 0.6


def test_the_door_is_a_clean_sheet_that_stands(door):
    extent = np.ptp(door.vertices_m, axis=0)
    np.testing.assert_allclose(extent, [1.2, 0.12, 0.89], atol=0.05)
    np.testing.assert_array_equal(door.down, [0, 0, -1])
    assert door.notes == ()
    assert (door.normals[:, 1] < -0.8).all()


@pytest.mark.slow
def test_the_script_draws_the_door_again(tmp_path):
    subprocess.run([sys.executable, SAMPLES / 'make_door.py', tmp_path], check=True)
    for name in ('door.stl', 'panel.stl'):
        kept, drawn = (np.frombuffer((p / name).read_bytes()[84:], np.uint8) for p in
                       (SAMPLES, tmp_path))  # fmt: skip
        assert len(kept) == len(drawn)
        assert np.mean(kept == drawn) > 0.99
