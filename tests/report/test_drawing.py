"""Pictures drawn by a second process."""

import os
import signal

import pytest

from paint_deposition.errors import PaintError
from paint_deposition.planning.trade_off import Point
from paint_deposition.report.drawing import HERE, DrawingProcess

PICTURE = 'trade_off:write_trade_off'


@pytest.fixture
def points():
    return [Point(weight, 0.05 * weight, 40.0, 30.0 / weight, 20.0, 8) for weight in (1.0, 2.0)]


@pytest.fixture
def drawing():
    with DrawingProcess('trade_off') as drawing:
        yield drawing


@pytest.mark.slow
def test_a_second_process_draws_what_this_one_would(tmp_path, drawing, points):
    here = HERE.start(PICTURE, tmp_path / 'here.png', points[0], points).result()
    there = drawing.start(PICTURE, tmp_path / 'there.png', points[0], points).result()
    assert there == tmp_path / 'there.png'
    assert there.read_bytes() == here.read_bytes()


@pytest.mark.slow
def test_what_keeps_it_from_drawing_is_raised_here_and_the_next_is_drawn(
    tmp_path, drawing, points
):
    (tmp_path / 'file').touch()
    failed = drawing.start(PICTURE, tmp_path / 'file' / 'a.png', points[0], points)
    drawn = drawing.start(PICTURE, tmp_path / 'a.png', points[0], points)
    with pytest.raises(OSError, match='file'):
        failed.result()
    assert drawn.result().is_file()


@pytest.mark.slow
def test_a_process_that_was_ended_is_told_in_a_line(tmp_path, points):
    with DrawingProcess('trade_off') as drawing:
        os.kill(drawing.pid, signal.SIGKILL)
        with pytest.raises(PaintError, match='more memory'):
            drawing.start(PICTURE, tmp_path / 'a.png', points[0], points).result()
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_it_ends_with_the_work():
    with DrawingProcess('trade_off') as other:
        os.kill(other.pid, 0)
    with pytest.raises(ProcessLookupError):
        os.kill(other.pid, 0)
