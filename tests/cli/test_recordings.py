"""`paint inspect` and `paint recover`, as a user runs them."""

import json

import pytest
import trimesh

from booth import SAMPLES
from cli.command import assert_refused, figures_of, paint, ran
from files.recorded import straight_pass
from paint_deposition.files.motion_files import read_recording
from paint_deposition.files.provenance import sha256
from paint_deposition.files.recordings.bags import write_pose_bag


@pytest.mark.slow
def test_inspect_a_real_bag(shared_data):
    done = ran('inspect', shared_data / 'bags/evo_ROS_example.bag')
    assert done.stderr == ''
    line = next(line for line in done.stdout.splitlines() if line.startswith('poses on groundtr'))
    assert "12765 in frame 'groundtruth' over 889.019 s" in line
    assert '95 gaps, longest interval 2.041 s' in line
    done = ran('inspect', shared_data / 'bags/evo_nav2_turtlebot.mcap')
    assert 'transforms: --tf TARGET SOURCE takes the motion from them' in done.stdout


def test_recover_does_what_inspect_says_of_an_unfinished_run(tmp_path):
    cut_run = write_pose_bag(tmp_path / 'run', straight_pass(4_000))
    content = (cut_run / 'run_0.mcap').read_bytes()
    (cut_run / 'run_0.mcap').write_bytes(content[: int(0.7 * len(content))])
    (cut_run / 'metadata.yaml').unlink()
    done = paint('inspect', cut_run)
    assert_refused(done)
    assert done.stderr.endswith(f'run: paint recover {cut_run}\n')
    figures = figures_of('recover', cut_run, '-o', tmp_path / 'whole', '--json')
    # A gap that is longer than clocks count is none.
    told = ran('inspect', tmp_path / 'whole', '--max-pose-gap-s', '1e300').stdout
    assert ' 0 gaps' in told
    assert figures['messages'] == sum(figures['topics'].values()) > 2_000
    done = ran('recover', cut_run)
    assert done.stderr == ''
    first, *_, last = done.stdout.splitlines()
    assert first.endswith('the end is missing')
    assert last.endswith('messages recovered: ' + str(tmp_path / 'run_recovered'))
    assert len(read_recording(tmp_path / 'run_recovered')) > 2_000
    refusal = 'run_recovered already exists; choose another name'
    assert_refused(paint('recover', cut_run), refusal)


def test_a_table_of_poses_says_what_was_understood(tmp_path):
    (tmp_path / 'poses.csv').write_text(
        't [ms];X [mm];Y [mm];Z [mm];A [deg];B [deg];C [deg]\n'
        '0;15,0;0;0;0;0;0\n20;95,0;0;0;0;0;0\n'
    )
    done = ran('inspect', tmp_path / 'poses.csv')
    first, understood, stream = done.stdout.splitlines()
    assert first.startswith('2 poses in a frame that is not named over 0.020 s: x 0.015 to 0.095,')
    assert understood.startswith('2 poses: x y z in mm; Euler angles A [deg] B [deg] C [deg]')
    assert stream.startswith('50.0 a second, 0 gaps, longest interval 0.020 s, 0 repeated and 0')
    told = figures_of('inspect', tmp_path / 'poses.csv', '--json')
    assert told['high_m'] == [0.095, 0.0, 0.0]
    (tmp_path / 'poses.csv').write_text('t,x,y,z,qx,qy,qz,qw,value\n0,0,0,0,0,0,0,1,20\n')
    assert figures_of('inspect', tmp_path / 'poses.csv', '--json')['poses'] == 1


def test_a_table_of_readings_says_its_zeros_repeats_and_gaps(tmp_path):
    (tmp_path / 'points.csv').write_text('no,x_m,y_m,z_m\n1,0,0,0\n2,0.5,0,0\n3,1,0,0\n4,2,0,0\n')
    (tmp_path / 'door.csv').write_text('point;DFT\n1;20,5\n1;21,5\n2;0\n3;n/a\n4;23\n')
    done = ran('inspect', 'door.csv', '--points', 'points.csv', cwd=tmp_path)
    assert done.stderr.startswith('warning: 1 readings are 0 (points 2): bare metal, or not meas')
    assert '(1 of them without a reading: 3)' in done.stdout
    assert '4 readings at 3 points, 1 of them measured again: noise of the gauge' in done.stdout
    assert 'film 0.0 to 23.0 µm, mean 16.2 µm\nx 0.000 to 2.000' in done.stdout
    figures = figures_of('inspect', 'door.csv', '--points', 'points.csv', '--json', cwd=tmp_path)
    assert (figures['zeros'], figures['repeated'], figures['readings']) == (['2'], ['1'], 4)
    assert_refused(paint('inspect', 'door.csv', cwd=tmp_path), 'have no coordinates', '--points')
    (tmp_path / 'B1').mkdir()
    (tmp_path / 'B1/header.txt').write_text('Name,B1\n')
    (tmp_path / 'B1/readings.txt').write_text('Reading,Value\n1,20\n2,21\n3,22\n4,21\n')
    (tmp_path / 'b.json').write_text(json.dumps([{'thickness': um} for um in (20, 21, 22, 21)]))
    for name in ('B1', 'b.json'):
        done = ran('inspect', name, '--points', 'points.csv', cwd=tmp_path)
        assert '4 readings at 4 points' in done.stdout


def test_a_point_read_in_two_layers_is_not_measured_again(tmp_path):
    (tmp_path / 'door.csv').write_text(
        'point,x_m,y_m,z_m,thickness_um,layer\n1,0,0,0,20,base\n1,0,0,0,41,total\n'
        '2,1,0,0,21,base\n2,1,0,0,22,base\n'
    )
    figures = figures_of('inspect', 'door.csv', '--json', cwd=tmp_path)
    assert (figures['points'], figures['repeated']) == (3, ['2, base'])


def test_a_table_with_every_sample_twice_says_the_rate_without_them(tmp_path):
    rows = [f'{0.004 * k:.3f},{0.01 * (k // 2):.2f},0,0,0,0,0,1' for k in range(200)]
    (tmp_path / 'poses.csv').write_text('\n'.join(['time_s,x_m,y_m,z_m,qx,qy,qz,qw', *rows]))
    done = paint('inspect', tmp_path / 'poses.csv')
    assert ' repeated samples (125.0 a second without them)' in done.stdout
    assert 'they are dropped, and 125 a second are left' in done.stderr


def test_a_mesh_says_its_size_and_unit(panel, tmp_path):
    """It is read with the scale and the body that are given."""
    part, mesh = tmp_path / 'part.stl', trimesh.load_mesh(panel)
    for scale, words in (
        (1.0, 'taken for metres'),
        (1e3, 'looks like millimetres, else it would be 1200 m large'),
    ):
        mesh.apply_scale(scale).export(part)
        first, unit, box = ran('inspect', part).stdout.splitlines()
        assert first == 'part.stl: a mesh of 2 triangles, 1.200 x 0.000 x 0.800 m, 0.96 m2'
        assert words in unit
        assert box == 'x -0.600 to 0.600, y 0.000 to 0.000, z -0.400 to 0.400 m'
    given = ('--mesh-scale', 0.001, '--body', 'part')
    figures = figures_of('inspect', part, *given, '--json')
    assert (figures['mesh_scale'], figures['high_m'][0]) == (0.001, pytest.approx(0.6))
    assert 'read with --mesh-scale 0.001' in ran('inspect', part, *given).stdout
    assert_refused(paint('inspect', part, '--body', 'lid'), "no body 'lid'")


def test_inspect_a_real_program(shared_data):
    module = shared_data / 'rapid/ECL_Grey_T_ROB1.mod'
    head, _, *moves, note, passed_over = paint('inspect', module).stdout.splitlines()
    assert head.startswith('module grey_t_rob1: 10 moves at 0.1 m/s, tool defaultghtool')
    assert moves[0].split()[:3] == ['14', 'movej', '0.6139']
    assert len(moves) == 10
    assert note == 'note: line 13: moveabsj skipped: joint angles are no pose'
    assert passed_over.startswith('note: passed over, neither motion nor paint: confl (line 11)')
    content = figures_of('inspect', module, '--json')
    assert content['moves'][0]['position_m'] == [0.61391, 2.32615, 1.04068]


def test_provenance_names_each_file_with_a_digest_of_content_and_names(tmp_path):
    bag = SAMPLES / 'door_horizontal'
    (file,) = figures_of('inspect', bag, '--json')['provenance']['files']
    assert file == {'what': 'recording', 'file': str(bag), 'sha256': sha256(bag)}
    (tmp_path / 'a').write_text('film')
    first = sha256(tmp_path)
    (tmp_path / 'a').rename(tmp_path / 'b')
    renamed = sha256(tmp_path)
    (tmp_path / 'b').write_text('films')
    assert len({first, renamed, sha256(tmp_path)}) == 3
