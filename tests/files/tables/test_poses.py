"""Tables of poses as robots and loggers write them: one motion in many layouts."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from paint_deposition.errors import RecordingError
from paint_deposition.files.motion_files import read_gun_motions, read_recording
from paint_deposition.request import MotionOptions
from refusals import refusal
from robot_arm import URDF
from workbook import write_workbook

# A gun that sways while it goes, and is on in the middle.
POSITIONS_M = np.array([
    [1.2, -0.25, 0.9], [1.21, -0.251, 0.9], [1.22, -0.25, 0.91], [1.232, -0.25, 0.9], [1.24, 0, 1],
])  # fmt: skip
TURNS = Rotation.from_euler(
    'ZYX', [[10, -20, 170], [12, -18, 175], [15, -15, 179], [20, -10, 170], [25, 5, 160]], True
)
ON = [0, 1, 1, 0, 0]
HEAD = 't,x,y,z,qx,qy,qz,qw'
# What must be said to read a file of `poses/`, each of which has the motion in another layout.
LAYOUTS = Path(__file__).with_name('poses')
SAID = {
    'kuka': {'pose_unit': 'mm'}, 'rotation_vector_deg': {'rotation': 'rotvec'},
    'z_first': {'rotation': 'ZYX'}, 'kawasaki': {'rotation': 'Kawasaki'},
}  # fmt: skip


@pytest.mark.parametrize('path', sorted(LAYOUTS.iterdir()), ids=lambda path: path.stem)
def test_every_layout_is_the_same_motion(path):
    read = read_recording(path, **SAID.get(path.stem, {}))
    assert np.array_equal(read.stamps_ns, [0, 20_000_000, 41_000_000, 60_000_000, 80_500_000])
    assert np.allclose(read.positions_m, POSITIONS_M, atol=1e-9)
    turned_by = (TURNS.inv() * Rotation.from_quat(read.quaternions_xyzw)).magnitude()
    assert turned_by.max() < 1e-7
    assert len(read.trigger_flow) == 0
    (note,) = read.notes
    assert note.startswith('5 poses: x y z in m')


@pytest.mark.parametrize(
    ('heading', 'flows', 'options'),
    [
        ('Gun on', ON, {}), ('flow', [0, 0.9, 1.1, 0, 0], {}),
        ('DO_12', ON, {'state_topic': 'DO_12'}),
        ('flow', [0, 0.9, 1.1, 0, 0], {'state_topic': 'flow'}),
        ('flow [ml/min]', ON, {'state_topic': 'flow [ml/min]'}),
        ('DO_12,flow', ['0,0', '1,0.9', '1,1.1', '0,0', '0,0'], {'state_topic': 'DO_12'}),
    ],
)  # fmt: skip
def test_the_trigger_holds_from_its_row_on(heading, flows, options, file):
    head, *rows = (LAYOUTS / 'plain.csv').read_text(encoding='utf-8-sig').splitlines()
    lines = (f'{row},{flow}' for row, flow in zip(rows, flows, strict=True))
    read = read_recording(file('p.csv', '\n'.join([f'{head},{heading}', *lines])), **options)
    assert np.array_equal(read.trigger_stamps_ns, read.stamps_ns)
    expected = [float(str(flow).rsplit(',')[-1]) for flow in flows]
    assert np.allclose(read.trigger_flow, expected)
    assert f'gun by {heading.replace(",", " ")}' in read.notes[0]


@pytest.mark.parametrize('axis', ['x', 'y', 'z', '-x', '-y', '-z'])
def test_the_tool_may_spray_along_another_of_its_axes(axis):
    read = read_recording(LAYOUTS / 'plain.csv', tool_axis=axis)
    sprays = Rotation.from_quat(read.quaternions_xyzw).as_matrix()[:, :, 2]
    column = TURNS.as_matrix()[:, :, 'xyz'.index(axis[-1])]
    assert sprays == pytest.approx(-column if axis[0] == '-' else column, abs=1e-6)


def test_a_turned_tool_keeps_the_norms_by_which_damage_is_known(file):
    rows = ['0,1,2,3,0,0,0,0.3', '1,1,2,4,0,0,0,0', '2,1,2,5,nan,0,0,1', '3,1,2,6,0,0,0,1.004']
    path = file('p.csv', '\n'.join([HEAD, *rows]))
    turned = read_recording(path, tool_axis='x').quaternions_xyzw
    norms = np.linalg.norm(turned, axis=1)
    assert norms == pytest.approx([0.3, 0.0, np.nan, 1.004], nan_ok=True)


def test_t_beside_o_and_a_is_an_angle(file):
    text = 'x,y,z,O,A,T,speed_m_per_s\n1,2,3,10,20,30,0.5\n1,2,4,10,20,30,0.5\n'
    read = read_recording(file('p.csv', text), rotation='kawasaki')
    assert read.duration_s == pytest.approx(2.0)


def test_what_could_be_the_trigger_is_named(file):
    rows = [f'{k / 10},{k},2,3,0,0,0,1,{word},0' for k, word in enumerate(('AUS', 'EIN', 'aus'))]
    path = file('p.csv', '\n'.join([f'{HEAD},Pistole,DO2', *rows]))
    (warning,) = read_recording(path).warnings
    assert warning.startswith('the gun counts as always on; if Pistole is its trigger')
    read = read_recording(path, state_topic='Pistole')
    assert (read.trigger_flow.tolist(), read.warnings) == ([0.0, 1.0, 0.0], ())


def test_an_empty_table_has_no_joints_either(file):
    with pytest.raises(RecordingError, match=r'no columns .* \(its first row: none\)'):
        read_recording(file('p.csv', ''), urdf=str(URDF))


def test_a_workbook_is_a_log_too(tmp_path):
    rows = [HEAD.split(','), [0, 1, 2, 3, 0, 0, 0, 1], [0.1, 1, 2, '4,5', 0, 0, 0, 1]]
    twice = write_workbook(tmp_path / 'twice.xlsx', {'Log': rows, 'Old': rows})
    with pytest.raises(RecordingError, match='from a file with one such sheet: save it by itself'):
        read_recording(twice)
    path = write_workbook(tmp_path / 'log.xlsx', {'Log': rows})
    assert read_recording(path).positions_m.tolist() == [[1, 2, 3], [1, 2, 4.5]]


def test_words_switch_the_gun_and_a_flow_counts_while_it_is_on(file):
    rows = ['0,1,2,3,0,0,0,1,on,0.8', '0.1,1,2,4,0,0,0,1,OFF,0.8', '0.2,1,2,5,0,0,0,1,true,nan']
    read = read_recording(file('p.csv', '\n'.join([f'{HEAD},trigger,flow', *rows])))
    assert read.trigger_flow.tolist() == [0.8, 0.0, 1.0]


@pytest.mark.parametrize(
    ('heading', 'cell', 'stamp'),
    [
        ('stamp_ns', '1760000000123456789', 1_760_000_000_123_456_789),
        ('t', '1760000000.123456789', 1_760_000_000_123_456_789),
        ('t', '−0.5', -500_000_000),
    ],
)
def test_times_keep_their_nanoseconds_and_the_minus_of_print(file, heading, cell, stamp):
    rows = [f'{heading},x,y,z,qx,qy,qz,qw', *(f'{cell},{x},0,0,0,0,0,1' for x in (0, 1))]
    assert read_recording(file('p.csv', '\n'.join(rows))).stamps_ns.tolist() == [stamp, stamp]


def test_a_second_gun_and_options_of_other_kinds_of_files_are_refused():
    with pytest.raises(RecordingError, match=r'plain\.csv is no bag and has the motion of one'):
        read_gun_motions([LAYOUTS / 'plain.csv'], MotionOptions(), ['a', 'b'])
    with pytest.raises(RecordingError, match='--pose-topic is for bags'):
        read_recording(LAYOUTS / 'plain.csv', '/pose')
    with pytest.raises(RecordingError, match="rotation: 'zxq' is no convention; give 'rotvec'"):
        read_recording(LAYOUTS / 'plain.csv', rotation='zxq')
    with pytest.raises(RecordingError, match="'ZZX' is no convention"):
        read_recording(LAYOUTS / 'plain.csv', rotation='ZZX')


def test_the_frame_of_the_poses_is_read(file):
    text = f'{HEAD},frame_id\n0,0,0,0,0,0,0,1,base\n1,1,0,0,0,0,0,1,base\n'
    assert read_recording(file('p.csv', text), frame_id='base').frame_id == 'base'
    with pytest.raises(RecordingError, match=r'p\.csv: poses in frames base, world'):
        read_recording(file('p.csv', text.replace('base\n1', 'world\n1')))


PASSES = 'x,y,z,qx,qy,qz,qw,speed\n0,0,0,0,0,0,1,1\n'


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('', 'no columns x, y, z'),
        (f'{HEAD}\n', 'no poses'),
        ('t,x,y,z,qx,qy,qz\n0,0,0,0,0,0,0\n', 'no orientation among the columns'),
        ('n,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n', 'no time among the columns'),
        (f'{HEAD}\n0,0,0,0,0,0,0,1\n0,0,?,0,0,0,0,1\n1,0\n', "line 3: y is '?'"),
        (f'{HEAD}\n0,2350,0,0,0,0,0,1\n', 'reach 2350 and have no unit'),
        ('t,x_mm,y,z,qx,qy,qz,qw\n0,2,0,0,0,0,0,1\n', 'in mm, no unit; give all in m or in mm'),
        ('t,x,y,z,rx_deg,ry_deg,rz_deg\n0,0,0,0,9,0,0\n', 'Euler angles or a rotation vector'),
        ('t,x,y,z,alpha,beta,gamma\n0,0,0,0,9,0,0\n', 'unknown convention'),
        ('t,x,y,z,roll,pitch,yaw\n0,0,0,0,90,0,0\n', 'reach 90 and are read in rad'),
        ('t,x,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,0,1\n', 'x x could all be x; keep one'),
        (f'{HEAD}\n0,0,0,0,0,0,0,1\n9e9,0,0,0,0,0,0,1\n', 'write its unit'),
        (f'{HEAD}\n0,0,0,1,0,0,0,0,0,0,0,1\n', 'line 2: 12 values under 8 column'),
        (f'{HEAD}\n8:15:02,0,0,0,0,0,0,1\n', "the time of day '8:15:02'; give sec"),
        (f'{HEAD}\ntrue,0,0,0,0,0,0,1\n', 'has a word for a number'),
        (f'{PASSES}1,0,0,0,0,0,0,1\n', 'line 3: 1 0 0 0 0 0 0 is no pose; give seven numbers'),
        (f'{PASSES}1,0,0,0,0,0,0.9,1\n', 'line 3: 1 0 0 0 0 0 0.9'),
        (f'{PASSES}nan,0,0,0,0,0,1,1\n', 'line 3: nan 0 0'),
        (f'{PASSES}1,0,0,0,0,0,1,inf\n', 'speed inf m/s; give'),
        (f'{HEAD},flow [ml/min]\n0,0,0,0,0,0,0,1,300\n', 'relative to the calibrated'),
    ],
)
def test_what_cannot_be_read_for_certain_is_refused(text, words, file):
    path = file('poses.csv', text)
    line = refusal(RecordingError, read_recording, path)
    assert str(path) in line
    assert words in line


@pytest.mark.parametrize(('suffix', 'rotation'), [('.src', 'kuka'), ('.LS', 'fanuc')])
def test_a_program_that_is_not_read_says_what_to_export(suffix, rotation, file):
    with pytest.raises(RecordingError, match=rf'as a table with x, .* --rotation {rotation}$'):
        read_recording(file(f'door{suffix}', 'DEF door()\nLIN P1\nEND\n'))
