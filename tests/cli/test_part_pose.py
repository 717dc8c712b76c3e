"""Where the part stands before the robot: from every source that says so, and `paint locate`."""

import json

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

import paint_deposition as pd
from cli.command import COARSE, assert_refused, figures_of, film_in, level_pass, paint, ran
from files.recorded import Messages, pose_entries, write_bag
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.motion.transforms import Rigid, moved

# The part stands two metres before the robot, turned and leaning.
PART_POSE = [2.1, -0.4, 0.9, *Rotation.from_euler('ZYX', [1.9, 0.3, -0.2]).as_quat().tolist()]
TOUCHED_POSE = Rigid.of([2.0, 0.5, 0.7, 0.0, 0.0, 0.6, 0.8])
POINTS = {'A': [0, 0, 0], 'B': [900, 0, 10], 'C': [850, 40, 600], 'D': [30, 0, 550]}


def seen_from_the_robot(frame_id: str = 'base_link') -> pd.Trajectory:
    """The same pass as the robot tells it."""
    return moved(level_pass(), Rigid.of(PART_POSE), frame_id)


def brought_to_the_part(path, **options) -> pd.Trajectory:
    """A recording as it is read, its poses those of the pass before the part."""
    read, expected = pd.read_recording(path, **options), level_pass()
    assert np.allclose(read.positions_m, expected.positions_m, atol=1e-6)
    turned, level = (Rotation.from_quat(one.quaternions_xyzw) for one in (read, expected))
    assert (turned * level.inv()).magnitude().max() < 1e-6
    return read


@pytest.mark.slow
def test_the_pose_of_the_part_brings_poses_to_it(panel, tmp_path):
    bag, out = write_pose_bag(tmp_path / 'run', seen_from_the_robot()), tmp_path / 'out'
    given = ('simulate', '--mesh', panel, *COARSE, '--json', '-o', out, '--trajectory')
    ran(*given, write_pose_bag(tmp_path / 'own', level_pass(frame_id='part')))
    expected = film_in(out)
    done = ran(*given, bag, '--part-pose', *PART_POSE)
    assert expected.max() > 5.0
    assert np.allclose(film_in(out), expected, atol=2e-3)
    (note,) = json.loads(done.stdout)['notes']
    assert note.startswith("part_pose: poses brought from 'base_link' to the part, which ")
    assert 'stands at 2.1 -0.4 0.9 ' in note
    assert done.stderr == f'note: {note}\n'


def test_poses_of_another_frame_are_warned_of_with_both_names(tmp_path):
    """Taken as they are: the mesh may be in that frame, too."""
    bag = write_pose_bag(tmp_path / 'run', level_pass(frame_id='cell'))
    (warning,) = brought_to_the_part(bag).warnings
    for words in ("in frame 'cell'", "'part'", '--frame-id cell', '--part-pose'):
        assert words in warning
    assert brought_to_the_part(bag, frame_id='cell').warnings == ()


def test_a_named_frame_that_nothing_leads_to_is_refused(tmp_path):
    bag = write_pose_bag(tmp_path / 'run', seen_from_the_robot())
    for options, words in (
        ({'frame_id': 'door'}, "'base_link'.*'door'.*--part-pose"),
        ({'frame_id': 'base_link', 'part_pose': PART_POSE},
         "'base_link'.*part_pose.*leave one of them out"),
    ):  # fmt: skip
        with pytest.raises(pd.PaintError, match=words):
            pd.read_recording(bag, **options)


@pytest.mark.parametrize('storage', ['mcap', 'ros1'])
def test_a_static_transform_of_the_recording_is_used_and_said(storage, tmp_path):
    """Two steps of it: the base carries a table, the table the part."""
    messages = Messages(ros1=storage == 'ros1')
    table = [1.0, 0.5, 0.2, 0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]
    on_table = Rigid.of(table).inverse() @ Rigid.of(PART_POSE)
    static = messages.transforms(
        (1, 'base_link', 'table', table), (1, '/table', 'door', on_table.values)
    )
    entries = pose_entries(seen_from_the_robot(), ros1=messages.ros1)
    path = tmp_path / ('run.bag' if messages.ros1 else 'run')
    write_bag(path, [('/tf_static', entries[0][1], static), *entries], storage, messages)
    (note,) = brought_to_the_part(path, frame_id='door').notes
    assert note.startswith("static transforms: poses brought from 'base_link' to 'door', ")
    assert 'stands at 2.1 -0.4 0.9 ' in note
    (warning,) = pd.read_recording(path).warnings
    assert 'static transforms connect it to door, table' in warning


def placed_bag(path, topic: str, *places: tuple[int, list[float]]):
    """The pass as the robot tells it, with the part's place told at these rows of it."""
    messages, entries = Messages(), pose_entries(seen_from_the_robot())
    for row, pose in places:
        told = messages.transforms((1, '/base_link', 'part', pose)).transforms[0]
        entries.append((topic, entries[row][1], told))
    return write_bag(path, sorted(entries, key=lambda entry: (entry[1], entry[0] != topic)))


def test_where_a_node_was_told_that_the_part_stands_is_used_but_not_guessed(tmp_path):
    once = placed_bag(tmp_path / 'run', '/cell_1/part_pose', (0, PART_POSE))
    (note,) = brought_to_the_part(once).notes
    assert note.startswith("static transforms: poses brought from 'base_link' to 'part', ")
    anew = placed_bag(tmp_path / 'anew', '/part_pose', (0, PART_POSE), (50, [2.2, *PART_POSE[1:]]))
    with pytest.raises(pd.PaintError, match=r"'part' was moved in 'base_link'.*--part-pose"):
        pd.read_recording(anew)


@pytest.mark.slow
def test_a_part_on_a_conveyor_is_followed(tmp_path):
    """It moves evenly at 0.2 m/s and is told at 10 Hz, from 0.5 s after the first pose on."""
    messages, at_part = Messages(), level_pass(frame_id='part')
    stamps = at_part.stamps_ns
    times_s = (stamps - stamps[0]) * 1e-9
    places = [Rigid.of([PART_POSE[0] + 0.2 * t, *PART_POSE[1:]]) for t in times_s]
    poses = map(Rigid.applied, places, at_part.positions_m, at_part.quaternions_xyzw)
    seen = pd.Trajectory(stamps, *map(np.array, zip(*poses, strict=True)), 'base_link')

    def run(name: str, first: int):
        told = [
            ('/tf', int(stamps[row]), messages.transforms(
                (int(stamps[row]), 'base_link', 'part', places[row].values)))
            for row in [*range(first, len(stamps), 5), len(stamps) - 1]
        ]  # fmt: skip
        entries = sorted([*told, *pose_entries(seen)], key=lambda entry: entry[1])
        return write_bag(tmp_path / name, entries)

    (note,) = brought_to_the_part(run('whole', 0)).notes
    assert note == f"/tf: {len(stamps)} poses brought to the moving part, 'part' in 'base_link'"
    late = pd.read_recording(run('late', 25))
    assert any("25 poses in frame 'base_link', of which 'part' is not" in w for w in late.warnings)
    assert np.allclose(late.positions_m, at_part.positions_m[25:], atol=1e-6)


@pytest.mark.slow
def test_campaigns_place_each_part(panel, tmp_path):
    """One by its own key, the other by the option for those without; both match the film."""
    bag = str(write_pose_bag(tmp_path / 'run', seen_from_the_robot()))
    own = str(write_pose_bag(tmp_path / 'own', level_pass(frame_id='part')))
    rows = [f'{x:.3f},0,{z},9' for x in np.linspace(-0.4, 0.4, 9) for z in (0.05, -0.05)]
    (tmp_path / 'readings.csv').write_text('\n'.join(['x_m,y_m,z_m,thickness_um', *rows]))

    def positions(of_others=None, **entry) -> np.ndarray:
        entry |= {'mesh': str(panel), 'measurements': 'readings.csv'}
        (tmp_path / 'campaign.yaml').write_text(yaml.safe_dump({'experiments': [entry]}))
        read = pd.read_campaign(tmp_path / 'campaign.yaml', part_pose=of_others)
        return read.experiments[0].path.position_m

    placed = positions(trajectory=bag, part_pose=PART_POSE)
    assert np.allclose(placed, positions(trajectory=own), atol=1e-6)
    assert np.array_equal(positions(PART_POSE, trajectory=bag), placed)


@pytest.fixture
def tables(tmp_path):
    """Touched points in metres with a decimal comma, the same in the part's frame in mm."""
    listed = np.array(list(POINTS.values())) * 1e-3
    touched, _ = TOUCHED_POSE.applied(listed, np.tile([0.0, 0, 0, 1], (len(listed), 1)))
    rows = [
        ';'.join([name, *(f'{value:.4f}'.replace('.', ',') for value in at)])
        for name, at in zip(POINTS, touched, strict=True)
    ]
    (tmp_path / 'touched.csv').write_text('\n'.join(['Point;X [m];Y [m];Z [m]', *rows]))
    rows = [f'{name},{x},{y},{z}' for name, (x, y, z) in POINTS.items()]
    (tmp_path / 'points.csv').write_text('\n'.join(['point,x_mm,y_mm,z_mm', *rows]))
    return ('--touched', tmp_path / 'touched.csv', '--points', tmp_path / 'points.csv')


def test_touched_points_give_the_pose_in_three_forms(tables):
    done = ran('locate', *tables)
    option, yaml, residual, *each = done.stdout.splitlines()
    values = [float(word) for word in option.removeprefix('--part-pose ').split()]
    assert np.allclose(values, TOUCHED_POSE.values, atol=2e-4)
    assert yaml == f'part_pose: [{", ".join(option.split()[1:])}]'
    assert residual.endswith(' mm RMS')
    assert [line.split(':')[0].strip() for line in each] == list(POINTS)
    figures = figures_of('locate', *tables, '--json')
    assert np.allclose(figures['part_pose'], TOUCHED_POSE.values, atol=2e-4)
    assert figures['rms_m'] < 2e-4
    assert set(figures['residuals_m']) == set(POINTS)
    # The unit that is given is that of headings without.
    assert ran('locate', *tables, '--pose-unit', 'mm').stdout == done.stdout
    bare = tables[3].read_text().replace('x_mm,y_mm,z_mm', 'x,y,z')
    tables[3].write_text(bare)
    assert ran('locate', *tables, '--pose-unit', 'mm').stdout == done.stdout


def test_bad_points_are_refused_with_their_files(tables, tmp_path):
    text = (tmp_path / 'points.csv').read_text()
    (tmp_path / 'points.csv').write_text(text.replace('B,', 'A,', 1))
    assert_refused(paint('locate', *tables), 'points.csv', "point 'A' is elsewhere in line 2")
    (tmp_path / 'points.csv').write_text(text.replace('B,', 'E,').replace('C,', 'F,'))
    assert_refused(paint('locate', *tables), 'touched.csv', '2 points in common (A D)')
    (tmp_path / 'points.csv').write_text(text.replace('point,', 'weight,'))
    assert_refused(paint('locate', *tables), 'points.csv', 'give a column point')
