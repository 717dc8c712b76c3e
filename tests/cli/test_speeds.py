"""`paint inspect --programmed`: a recorded run beside the module that the robot ran."""

import json

import pytest
from PIL import Image

from cli.command import assert_refused, paint
from motion.test_driven_speed import SPEED, programme, slowed
from paint_deposition.files.rapid.writer import module_text
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.motion.programmed import Move


@pytest.fixture
def run(tmp_path):
    """A recorded run and its module."""
    planned = programme()
    turns = [0, *planned.trigger_stamps_ns[1:].tolist(), int(planned.stamps_ns[-1])]
    rows = planned.stamps_ns.searchsorted(sorted({*turns}))
    spraying = [False, *(bool(number % 2) for number in range(1, len(rows)))]
    moves = [
        Move(planned.positions_m[row], planned.quaternions_xyzw[row], SPEED, on)
        for row, on in zip(rows, spraying, strict=True)
    ]
    module = tmp_path / 'passes.mod'
    module.write_text(module_text(moves))
    return write_pose_bag(tmp_path / 'run', slowed()), module


STATES = ('--state-topic', '/atomizer/state')


def test_speeds_are_told_by_pass_and_drawn(run, tmp_path):
    recorded, module = run
    done = paint(
        'inspect', recorded, '--programmed', module, *STATES, '-o', tmp_path / 'speed.png'
    )
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert [line.split(':')[0] for line in lines[:4]] == ['pass 1', 'pass 2', 'pass 3', 'all']
    assert 'programmed 0.500 m/s' in lines[0]
    assert '; film +0.0 %' in lines[1]
    assert lines[4] == '100 % of the way sprayed lies on the programme'
    with Image.open(tmp_path / 'speed.png') as picture:
        colours = {colour for _, colour in picture.convert('RGB').getcolors(1 << 24)}
    assert bytes.fromhex('00708c') in map(bytes, colours)
    figures = json.loads(
        paint('inspect', recorded, '--programmed', module, *STATES, '--json').stdout
    )
    assert len(figures['passes']) == 3
    assert figures['passes'][0]['slower'] > 0.1
    assert figures['passes'][1]['slower_at_ends'] is None


def test_what_does_not_go_together_is_refused(run, tmp_path):
    recorded, module = run
    done = paint('inspect', recorded, '--programmed', module, '--mesh', module)
    assert_refused(done, '--programmed cannot be combined with --mesh')
    away = (*STATES, '--part-pose', 0, 1, 0, 0, 0, 0, 1)
    done = paint('inspect', recorded, '--programmed', module, *away)
    assert done.returncode == 2
    assert 'only 0 % of the way sprayed lies within 50 mm of the programme' in done.stderr
