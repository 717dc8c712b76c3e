"""Poses in the robot's frame, by the real commands: where the part stands in it."""

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from cli.command import COARSE, assert_refused, film_in, level_pass, paint
from files.recorded import Messages, pose_entries, write_bag
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.motion.part_frame import Rigid
from paint_deposition.motion.trajectory import Trajectory

# The part stands two metres before the robot, turned and leaning.
PART_POSE = [2.1, -0.4, 0.9, *Rotation.from_euler('ZYX', [1.9, 0.3, -0.2]).as_quat().tolist()]


def seen_from_the_robot(frame_id: str = 'base_link') -> Trajectory:
    """The same pass as the robot tells it."""
    at_part = level_pass(frame_id=frame_id)
    poses = Rigid.of(PART_POSE).applied(at_part.positions_m, at_part.quaternions_xyzw)
    return Trajectory(at_part.stamps_ns, *poses, frame_id)


@pytest.fixture(scope='module')
def expected(panel, tmp_path_factory):
    """The film of the pass in the frame of the mesh."""
    folder = tmp_path_factory.mktemp('expected')
    bag = write_pose_bag(folder / 'run', level_pass(frame_id='part'))
    film, stderr = simulated(panel, bag, folder / 'out')
    assert stderr == ''
    assert film.max() > 5.0
    return film


def simulated(mesh, motion, out, *more):
    done = paint('simulate', '--mesh', mesh, '--trajectory', motion, *COARSE, *more, '-o', out)
    assert done.returncode == 0, done.stderr
    return film_in(out), done.stderr


@pytest.mark.slow
def test_the_pose_of_the_part_brings_poses_to_it(panel, expected, tmp_path):
    bag = write_pose_bag(tmp_path / 'run', seen_from_the_robot())
    film, said = simulated(panel, bag, tmp_path / 'out', '--part-pose', *PART_POSE)
    assert np.allclose(film, expected, atol=2e-3)
    assert said.startswith("note: part_pose: poses brought from 'base_link' to the part, which ")
    assert 'stands at 2.1 -0.4 0.9 ' in said
    quoted = ('--part-pose', ' '.join(map(str, PART_POSE)))
    assert np.array_equal(simulated(panel, bag, tmp_path / 'out', *quoted)[0], film)


@pytest.mark.slow
def test_poses_of_another_frame_are_warned_of_with_both_names(panel, expected, tmp_path):
    """Taken as they are: the mesh may be in that frame, too."""
    bag = write_pose_bag(tmp_path / 'run', level_pass(frame_id='cell'))
    film, said = simulated(panel, bag, tmp_path / 'out')
    assert np.array_equal(film, expected)
    assert said.startswith('warning: ')
    for words in ("in frame 'cell'", "'part'", '--frame-id cell', '--part-pose'):
        assert words in said
    film, said = simulated(panel, bag, tmp_path / 'out', '--frame-id', 'cell')
    assert np.array_equal(film, expected)
    assert said == ''


def test_a_named_frame_that_nothing_leads_to_is_refused(panel, tmp_path):
    bag = write_pose_bag(tmp_path / 'run', seen_from_the_robot())
    given = ('simulate', '--mesh', panel, '--trajectory', bag, '-o', tmp_path / 'out')
    done = paint(*given, '--frame-id', 'door')
    assert_refused(done, "'base_link'", "'door'", '--part-pose')
    done = paint(*given, '--frame-id', 'base_link', '--part-pose', *PART_POSE)
    assert_refused(done, "'base_link'", 'part_pose', 'leave one of them out')
    assert not (tmp_path / 'out').exists()


@pytest.mark.slow
@pytest.mark.parametrize('storage', ['mcap', 'ros1'])
def test_a_static_transform_of_the_recording_is_used_and_said(panel, expected, storage, tmp_path):
    """Two steps of it: the base carries a table, the table the part."""
    messages = Messages(ros1=storage == 'ros1')
    table = [1.0, 0.5, 0.2, 0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]
    on_table = Rigid.of(table).inverse() @ Rigid.of(PART_POSE)
    static = messages.transforms(
        (1, 'base_link', 'table', table), (1, '/table', 'door', on_table.values)
    )
    entries = pose_entries(seen_from_the_robot(), ros1=messages.ros1)
    first_ns = entries[0][1]
    path = tmp_path / ('run.bag' if messages.ros1 else 'run')
    write_bag(path, [('/tf_static', first_ns, static), *entries], storage, messages)
    film, said = simulated(panel, path, tmp_path / 'out', '--frame-id', 'door')
    assert np.allclose(film, expected, atol=2e-3)
    assert said.startswith("note: static transforms: poses brought from 'base_link' to 'door', ")
    assert 'stands at 2.1 -0.4 0.9 ' in said
    _, said = simulated(panel, path, tmp_path / 'out')
    assert 'it stands still to door, table' in said


@pytest.mark.slow
def test_where_a_node_was_told_that_the_part_stands_is_used(panel, expected, tmp_path):
    messages = Messages()
    entries = pose_entries(seen_from_the_robot())
    told = messages.transforms((1, '/base_link', 'part', PART_POSE)).transforms[0]
    path = write_bag(tmp_path / 'run', [('/cell_1/part_pose', entries[0][1], told), *entries])
    film, said = simulated(panel, path, tmp_path / 'out')
    assert np.allclose(film, expected, atol=2e-3)
    assert said.startswith("note: static transforms: poses brought from 'base_link' to 'part', ")


def test_a_part_that_was_placed_anew_in_a_run_is_not_guessed(panel, tmp_path):
    messages = Messages()
    entries = pose_entries(seen_from_the_robot())
    told = [
        messages.transforms((1, 'base_link', 'part', [x, *PART_POSE[1:]])).transforms[0]
        for x in (2.1, 2.2)
    ]
    placed = [('/part_pose', entries[0][1], told[0]), ('/part_pose', entries[50][1], told[1])]
    path = write_bag(tmp_path / 'run', sorted([*placed, *entries], key=lambda e: e[1]))
    done = paint('simulate', '--mesh', panel, '--trajectory', path, '-o', tmp_path / 'out')
    assert_refused(done, "'part' was placed anew in 'base_link'", 'give --part-pose')


@pytest.mark.slow
def test_a_part_on_a_conveyor_is_followed(panel, expected, tmp_path):
    """It moves evenly at 0.2 m/s and is told at 10 Hz, from 0.5 s after the first pose on."""
    messages, at_part = Messages(), level_pass(frame_id='part')
    times_s = (at_part.stamps_ns - at_part.stamps_ns[0]) * 1e-9
    places = [Rigid.of([PART_POSE[0] + 0.2 * t, *PART_POSE[1:]]) for t in times_s]
    poses = [
        place.applied(*pose)
        for place, *pose in zip(places, at_part.positions_m, at_part.quaternions_xyzw, strict=True)
    ]
    stamps = at_part.stamps_ns
    seen = Trajectory(stamps, *map(np.array, zip(*poses, strict=True)), 'base_link')

    def run(name: str, first: int):
        told = [
            ('/tf', int(stamps[row]), messages.transforms(
                (int(stamps[row]), 'base_link', 'part', places[row].values)))
            for row in [*range(first, len(stamps), 5), len(stamps) - 1]
        ]  # fmt: skip
        entries = sorted([*told, *pose_entries(seen)], key=lambda entry: entry[1])
        return write_bag(tmp_path / name, entries)

    film, said = simulated(panel, run('whole', 0), tmp_path / 'out')
    assert np.allclose(film, expected, atol=2e-3)
    assert (
        said
        == f"note: /tf: {len(stamps)} poses brought to the moving part, 'part' in 'base_link'\n"
    )
    late, said = simulated(panel, run('late', 25), tmp_path / 'out')
    assert '25 of 150 poses are left out' in said
    assert (late <= film + 2e-3).all()
    assert late.sum() < 0.99 * film.sum()


@pytest.mark.slow
def test_campaigns_place_each_part(panel, tmp_path):
    """One by its own key, the other by the option for those without; both match the film."""
    bag = write_pose_bag(tmp_path / 'run', seen_from_the_robot())
    own = write_pose_bag(tmp_path / 'own', level_pass(frame_id='part'))
    x = np.linspace(-0.4, 0.4, 9)
    rows = [f'{value:.3f},0,{0.05 - 0.1 * k:.3f},9' for value in x for k in (0, 1)]
    readings = '\n'.join(['x_m,y_m,z_m,thickness_um', *rows])
    (tmp_path / 'readings.csv').write_text(readings)
    (tmp_path / 'model.yaml').write_text('effects: []\n')

    def predicted(entry: dict, *more) -> np.ndarray:
        entry |= {'mesh': str(panel), 'measurements': 'readings.csv'}
        (tmp_path / 'campaign.yaml').write_text(yaml.safe_dump({'experiments': [entry]}))
        out, model = tmp_path / 'out', tmp_path / 'model.yaml'
        done = paint('compare', tmp_path / 'campaign.yaml', '--model', model, *more, '-o', out)
        assert done.returncode == 0, done.stderr
        return np.genfromtxt(out / 'residuals.csv', delimiter=',', names=True)['predicted_um']

    expected_um = predicted({'trajectory': str(own)})
    assert expected_um.max() > 5.0
    placed = predicted({'trajectory': str(bag), 'part_pose': PART_POSE})
    assert np.allclose(placed, expected_um, atol=2e-3)
    placed = predicted({'trajectory': str(bag)}, '--part-pose', *PART_POSE)
    assert np.allclose(placed, expected_um, atol=2e-3)
