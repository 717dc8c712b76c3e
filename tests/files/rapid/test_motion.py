"""The motion of RAPID programs: where the TCP is when, and when the gun sprays."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from paint_deposition.errors import RecordingError
from paint_deposition.files.rapid.program import program_trajectory, read_program
from paint_deposition.motion.path_builder import spray_path

AXES = '[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]'


def target(x, y=0.0, z=250.0, wxyz='0,1,0,0') -> str:
    return f'[[{x},{y},{z}],[{wxyz}],{AXES}]'


@pytest.fixture
def motion(tmp_path):
    """`motion(body)`: the trajectory of a module with this `main`."""

    def motion(body: str):
        path = tmp_path / 'test.mod'
        path.write_text(f'MODULE Test\nPROC main()\n{body}\nENDPROC\nENDMODULE\n')
        return program_trajectory(read_program(path))

    return motion


def at(trajectory, time_s):
    """Place at a time after the start."""
    times_s = (trajectory.stamps_ns - trajectory.stamps_ns[0]) * 1e-9
    return [np.interp(time_s, times_s, trajectory.positions_m[:, k]) for k in range(3)]


def test_speeds_are_the_programmed_ones(motion):
    trajectory = motion(
        f'MoveJ {target(0)},v1000,fine,tool0;'
        f'MoveL {target(300)},v500,z10,tool0;'
        f'MoveL {target(300, 200)},v100,fine,tool0;'
    )
    assert trajectory.duration_s == pytest.approx(0.6 + 2.0, abs=1e-9)
    np.testing.assert_allclose(at(trajectory, 0.3), [0.15, 0.0, 0.25], atol=1e-9)
    np.testing.assert_allclose(at(trajectory, 1.6), [0.3, 0.1, 0.25], atol=1e-9)
    assert 'zones are not followed: corners are sharp' in trajectory.notes


def test_a_program_without_a_gun_sprays_all_the_way_and_says_so(motion, shared_data):
    program = read_program(shared_data / 'rapid/ECL_Grey_T_ROB1.mod')
    trajectory = program_trajectory(program)
    legs = np.diff([move.position_m for move in program.moves], axis=0)
    expected_s = np.linalg.norm(legs, axis=1).sum() / 0.1
    path, counts = spray_path(trajectory)
    assert path.spraying_time_s == pytest.approx(expected_s, rel=1e-9)
    assert counts.rejected == counts.gaps == 0
    assert (
        'nothing in the program switches the gun: it is taken as spraying throughout'
        in trajectory.notes
    )
    assert 'joint moves are taken as straight' in trajectory.notes


@pytest.mark.parametrize('sweep_deg', [30.0, 180.0, 300.0])
def test_circular_moves_are_arcs(motion, sweep_deg):
    middle, end = np.radians([0.4 * sweep_deg, sweep_deg])
    via, last = ((200 * np.cos(a), 200 * np.sin(a)) for a in (middle, end))
    trajectory = motion(
        f'MoveL {target(200)},v100,fine,tool0;'
        f'MoveC {target(*np.round(via, 9))},{target(*np.round(last, 9))},v100,fine,tool0;'
    )
    radius_m = np.linalg.norm(trajectory.positions_m[:, :2], axis=1)
    np.testing.assert_allclose(radius_m, 0.2, atol=1e-9)
    assert trajectory.duration_s == pytest.approx(0.2 * end / 0.1, abs=1e-6)


def test_a_tool_that_only_turns_takes_its_time(motion):
    w, x, y, z = Rotation.from_euler('z', 90.0, degrees=True).as_quat()[[3, 0, 1, 2]]
    trajectory = motion(
        f'MoveL {target(0, wxyz="1,0,0,0")},v500,fine,tool0;'
        f'MoveL {target(0, wxyz=f"{w},{x},{y},{z}")},v500,fine,tool0;'
    )
    assert trajectory.duration_s == pytest.approx(90.0 / 500.0, abs=1e-6)
    assert np.all(np.ptp(trajectory.positions_m, axis=0) == 0.0)


@pytest.mark.parametrize(
    ('end', 'speed', 'words'),
    [
        ('', '', 'a single move'),
        (target(1), '[0,500,0,0]', 'speed 0 m/s'),
        (target('1e12'), 'v100', r'line 4: a move of 1e\+09 m at 0.1 m/s takes .* h'),
    ],
)
def test_what_is_no_motion_is_refused(motion, end, speed, words):
    second = f'MoveL {end},{speed},fine,tool0;' if end else ''
    with pytest.raises(RecordingError, match=words):
        motion(f'MoveL {target(0)},v500,fine,tool0;\n{second}')
