"""RAPID programs on the command line: `paint inspect` and `paint simulate`."""

import json

import numpy as np
import pytest
import trimesh

from booth import LOOKING_ALONG_Y, SAMPLES
from cli.command import assert_refused, paint
from paint_deposition.files.rapid.writer import module_text
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.motion.programmed import Move
from scenes import straight_pass


def test_inspect_a_real_program(shared_data):
    module = shared_data / 'rapid/ECL_Grey_T_ROB1.mod'
    done = paint('inspect', module)
    assert done.returncode == 0, done.stderr
    head, _, *moves, note = done.stdout.splitlines()
    assert head.startswith('module grey_t_rob1: 10 moves at 0.1 m/s, tool defaultghtool')
    assert [line.split()[:3] for line in moves[:1]] == [['14', 'movej', '0.6139']]
    assert len(moves) == 10
    assert note == 'note: line 13: moveabsj skipped: joint angles need the robot'
    content = json.loads(paint('inspect', module, '--json').stdout)
    assert content['moves'][0]['position_m'] == [0.61391, 2.32615, 1.04068]
    assert content['gun_signal'] == ''


def test_a_program_paints_like_the_recording_of_its_motion(tmp_path):
    recorded = straight_pass(
        np.arange(0.0, 3.0, 0.02), (-0.5, -0.25, 0.05), (0.5, -0.25, -0.05), LOOKING_ALONG_Y
    )
    bag = write_pose_bag(tmp_path / 'bag', recorded)
    corners = [[-0.6, 0, -0.4], [0.6, 0, -0.4], [0.6, 0, 0.4], [-0.6, 0, 0.4]]
    trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False).export(tmp_path / 'panel.stl')
    begin_m, end_m = recorded.positions_m[[0, -1]]
    speed_m_per_s = float(np.linalg.norm(end_m - begin_m)) / recorded.duration_s
    moves = [
        Move(place_m, LOOKING_ALONG_Y, speed_m_per_s, spraying)
        for place_m, spraying in ((begin_m, False), (end_m, True))
    ]
    module = tmp_path / 'passes.mod'
    module.write_text(module_text(moves))
    figures = []
    for trajectory in (module, bag):
        done = paint(
            'simulate', '--mesh', tmp_path / 'panel.stl', '--trajectory', trajectory, '--json',
            '--max-edge-length-m', 0.05, '-o', tmp_path / 'painted',
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        figures.append(json.loads(done.stdout))
    program, recording = figures
    assert program['mean_um'] == pytest.approx(recording['mean_um'], rel=1e-4)
    assert program['spraying_time_s'] == pytest.approx(recording['spraying_time_s'], rel=1e-5)
    assert 'speeds are taken as programmed; acceleration is left out' in program['notes']


def test_a_program_has_no_topics_and_a_bag_no_gun_signal(tmp_path):
    module = tmp_path / 'passes.mod'
    module.write_text('')
    given = ('--mesh', SAMPLES / 'door.stl', '-o', tmp_path / 'out', '--trajectory')
    done = paint('simulate', *given, module, '--state-topic', '/atomizer/state')
    assert_refused(done, '--state-topic is for bags', 'is a RAPID module; leave it out')
    for command in (('inspect',), ('simulate', *given)):
        done = paint(*command, SAMPLES / 'door_horizontal', '--gun-signal', 'doGun')
        assert_refused(done, '--gun-signal is for RAPID modules')
    assert not (tmp_path / 'out').exists()
