"""`paint measure` as a user runs it, and the way of its points back into a campaign."""

import csv
import json

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

import paint_deposition as pd
from booth import SAMPLES
from cli.command import assert_refused, figures_of, paint, ran
from paint_deposition.errors import ReadingsError
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.motion.part_frame import Rigid, moved

DOOR = ('--mesh', SAMPLES / 'door.stl', '--max-edge-length-m', 0.05)
PAINTED = (*DOOR, '--trajectory', SAMPLES / 'door_horizontal')


@pytest.fixture(scope='module')
def measured(tmp_path_factory):
    folder = tmp_path_factory.mktemp('measured')
    done = ran('measure', *PAINTED, '--points', 30, '-o', folder)
    return folder, done


def rows_of(path) -> list[dict]:
    with path.open(newline='') as file:
        return list(csv.DictReader(file))


@pytest.mark.slow
def test_points_are_written_for_people_and_robots(measured):
    folder, done = measured
    figures = json.loads((folder / 'measure.json').read_text())
    rows, poses = rows_of(folder / 'points.csv'), rows_of(folder / 'poses.csv')
    assert [row['point'] for row in rows] == [p['point'] for p in figures['points']] + figures[
        'read_twice'
    ]
    assert len(poses) == len(figures['points']) == 30
    assert 'detected with a probability' in done.stdout
    for pose, point in zip(poses, figures['points'], strict=True):
        turn = Rotation.from_quat([float(pose[q]) for q in ('qx', 'qy', 'qz', 'qw')])
        np.testing.assert_allclose(turn.apply([0, 0, 1]), -np.array(point['normal']), atol=1e-6)
    with Image.open(folder / 'points.png') as picture:
        assert picture.width > 1000


@pytest.mark.slow
def test_the_filled_table_is_gauge_readings_and_the_empty_one_is_refused(measured, tmp_path):
    folder, _ = measured
    surface, path = pd.read_mesh(SAMPLES / 'door.stl'), tmp_path / 'readings.csv'
    path.write_text((folder / 'points.csv').read_text())
    with pytest.raises(ReadingsError, match='no readings below the header'):
        pd.read_readings(path, surface=surface)
    rows = rows_of(path)
    with path.open('w', newline='') as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(row | {'thickness_um': row['expected_um']} for row in rows)
    readings = pd.read_readings(path, surface=surface)
    assert (len(readings), len(set(readings.point))) == (38, 30)
    assert surface.locate(readings.positions_m).distance_m.max() < 1e-3


@pytest.mark.slow
def test_poses_stand_in_the_frame_of_the_robot(measured, tmp_path):
    pose = (1.0, 0.5, 0.0, 0, 0, 1, 0)
    # The same motion, given in the robot's frame: the part is turned by half a turn there.
    motion = moved(pd.read_recording(SAMPLES / 'door_horizontal'), Rigid.of(pose), 'base_link')
    figures = figures_of(
        'measure', *DOOR, '--trajectory', write_pose_bag(tmp_path / 'run', motion), '--part-pose',
        *pose, '--points', 12, '--repeats', 0, '--json', '-o', tmp_path / 'out',
    )  # fmt: skip
    first = rows_of(tmp_path / 'out/poses.csv')[0]
    assert float(first['x_m']) == pytest.approx(1.0 - figures['points'][0]['x_m'], abs=1e-5)
    assert figures['read_twice'] == []


@pytest.mark.slow
def test_without_a_trajectory_passes_are_planned(tmp_path):
    done = ran('measure', *DOOR, '--target-um', 25, '--points', 16, '--json', '-o', tmp_path)
    films = [point['expected_um'] for point in json.loads(done.stdout)['points']]
    assert np.mean(films) == pytest.approx(25.0, rel=0.2)


def test_a_part_that_nobody_paints_is_refused(tmp_path):
    assert_refused(paint('measure', *DOOR, '-o', tmp_path), '--trajectory', '--target-um')
