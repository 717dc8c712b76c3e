"""`paint locate` over real files, as a user runs it."""

import json

import numpy as np
import pytest

from cli.command import assert_refused, paint
from paint_deposition.motion.part_frame import Rigid

POSE = Rigid.of([2.0, 0.5, 0.7, 0.0, 0.0, 0.6, 0.8])
POINTS = {'A': [0, 0, 0], 'B': [900, 0, 10], 'C': [850, 40, 600], 'D': [30, 0, 550]}


@pytest.fixture
def tables(tmp_path):
    """Touched points in metres with a decimal comma, the same in the part's frame in mm."""
    listed = np.array(list(POINTS.values())) * 1e-3
    touched, _ = POSE.applied(listed, np.tile([0.0, 0, 0, 1], (len(listed), 1)))
    rows = [
        ';'.join([name, *(f'{value:.4f}'.replace('.', ',') for value in at)])
        for name, at in zip(POINTS, touched, strict=True)
    ]
    (tmp_path / 'touched.csv').write_text('\n'.join(['Point;X [m];Y [m];Z [m]', *rows]))
    rows = [f'{name},{x},{y},{z}' for name, (x, y, z) in POINTS.items()]
    (tmp_path / 'points.csv').write_text('\n'.join(['point,x_mm,y_mm,z_mm', *rows]))
    return ('--touched', tmp_path / 'touched.csv', '--points', tmp_path / 'points.csv')


def test_touched_points_give_the_pose_in_three_forms(tables):
    done = paint('locate', *tables)
    assert done.returncode == 0, done.stderr
    option, yaml, residual, *each = done.stdout.splitlines()
    values = [float(word) for word in option.removeprefix('--part-pose ').split()]
    assert np.allclose(values, POSE.values, atol=2e-4)
    assert yaml == f'part_pose: [{", ".join(option.split()[1:])}]'
    assert residual.endswith(' mm RMS')
    assert [line.split(':')[0].strip() for line in each] == list(POINTS)
    figures = json.loads(paint('locate', *tables, '--json').stdout)
    assert np.allclose(figures['part_pose'], POSE.values, atol=2e-4)
    assert figures['rms_m'] < 2e-4
    assert set(figures['residuals_m']) == set(POINTS)


def test_bad_points_are_refused_with_their_files(tables, tmp_path):
    text = (tmp_path / 'points.csv').read_text()
    (tmp_path / 'points.csv').write_text(text.replace('B,', 'A,', 1))
    assert_refused(paint('locate', *tables), 'points.csv', "point 'A' is elsewhere in line 2")
    (tmp_path / 'points.csv').write_text(text.replace('B,', 'E,').replace('C,', 'F,'))
    assert_refused(paint('locate', *tables), 'touched.csv', '2 points in common (A D)')
    (tmp_path / 'points.csv').write_text(text.replace('point,', 'weight,'))
    assert_refused(paint('locate', *tables), 'points.csv', 'give a column point')


def test_both_lists_must_be_given(tables):
    assert_refused(paint('locate', *tables[:2]), "Missing option '--points'")
