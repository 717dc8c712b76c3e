"""`paint inspect --mesh`: how the gun ran over a part, in words, figures and a picture."""

import json

import numpy as np
import pytest
from PIL import Image

from booth import SAMPLES
from cli.command import assert_refused, paint

DOOR, DOOR_BAG = SAMPLES / 'door.stl', SAMPLES / 'door_horizontal'
TRIGGER = ('--state-topic', '/atomizer/state')
BOTH = ('inspect', '--mesh', DOOR, '--trajectory', DOOR_BAG)


@pytest.mark.slow
def test_the_gun_over_the_door_is_told_and_drawn(tmp_path):
    picture = tmp_path / 'door.png'
    done = paint(*BOTH, *TRIGGER, '--out', picture)
    assert (done.returncode, done.stderr) == (0, '')
    assert done.stdout.startswith('3 passes, 0.30 m/s, TCP 0.25 m from the surface')
    assert str(picture) in done.stdout
    with Image.open(picture) as image:
        assert min(image.size) > 1000
        # Each pass has a colour of its own.
        colours = {colour for _, colour in image.convert('RGB').getcolors(1 << 24)}
    for wanted in ('#00708c', '#d1701f', '#7a5195'):
        assert tuple(bytes.fromhex(wanted[1:])) in colours


def test_figures_are_those_of_the_line(tmp_path):
    done = paint(*BOTH, *TRIGGER, '--json')
    figures = json.loads(done.stdout)
    assert figures['geometry']['passes'] == 3
    assert figures['frame_id'] == 'part'
    assert figures['mesh_file'] == str(DOOR)
    assert figures['picture'] is None
    line = paint('inspect', DOOR_BAG, '--mesh', DOOR, *TRIGGER).stdout.splitlines()[0]
    assert figures['geometry']['sentence'] == line
    assert np.isclose(figures['geometry']['standoff_m'], 0.25, atol=0.01)


def test_what_is_missing_is_asked_for():
    assert_refused(paint('inspect'), 'RECORDING', '--mesh', '--trajectory')
    assert_refused(paint('inspect', '--mesh', DOOR), '--trajectory')
    assert_refused(paint('inspect', DOOR_BAG, '--out', 'a.png'), '--mesh')
