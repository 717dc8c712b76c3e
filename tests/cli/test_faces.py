"""`paint plan --faces auto` as a user runs it."""

import json

import pytest
import trimesh

from cli.command import assert_refused, paint
from folded_parts import hood


@pytest.fixture
def mesh(tmp_path):
    surface = hood(0.06)
    path = tmp_path / 'hood.ply'
    trimesh.Trimesh(surface.vertices_m, surface.faces, process=False).export(path)
    return path


@pytest.mark.slow
@pytest.mark.usefixtures('undrawn')
def test_speeds_along_the_passes_even_the_seams_of_two_faces_further(mesh, tmp_path):
    options = ('--faces', 'auto', '--target-um', 20, '--max-edge-length-m', 0.06, '--json')
    plans = []
    for more in (('--keep-off-m', 0.4), ('--optimise',)):
        done = paint('plan', '--mesh', mesh, *options, *more, '-o', tmp_path / 'plan')
        assert done.returncode == 0, done.stderr
        plans.append(json.loads(done.stdout))
        near = 'warning: the part is too near before the gun at (' in done.stderr
        assert near == ('--keep-off-m' in more)
    names = {path.name for path in (tmp_path / 'plan').iterdir()}
    assert {'trajectory', 'passes.csv', 'passes.mod', 'passes.png', 'film.png'} <= names
    assert len(plans[0]['faces']) == 2
    assert plans[0]['sigma_n'] < plans[0]['sigma_n_unblended']
    assert plans[1]['sigma_n'] < 0.95 * plans[0]['sigma_n']
    assert plans[1]['film']['mean_um'] == pytest.approx(20.0, rel=0.01)
    assert not plans[1]['contacts']


def test_an_angle_that_is_none_is_refused(mesh, tmp_path):
    options = ('--faces', 'auto', '--target-um', 20, '--face-angle-deg', 90)
    assert_refused(paint('plan', '--mesh', mesh, *options, '-o', tmp_path / 'plan'), '90')
