"""Progress as a terminal shows it."""

import io
import time
from contextlib import redirect_stderr

import pytest

from paint_deposition.cli.results import Progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def shown(terminal: Terminal, count: int) -> list[str]:
    """What the line said once it was drawn this often, without another word from the work."""
    deadline = time.monotonic() + 60.0
    while terminal.getvalue().count('\r') < count and time.monotonic() < deadline:
        time.sleep(0.01)
    return [line.strip() for line in terminal.getvalue().split('\r') if line.strip()]


@pytest.mark.slow
def test_the_clock_runs_within_a_step_and_a_known_share_is_a_bar():
    terminal = Terminal()
    with redirect_stderr(terminal), Progress('diagnose', after_s=0.0) as show:
        show('fitting the pattern')
        lines = shown(terminal, 3)
        assert lines[-1].startswith('diagnose: fitting the pattern [00:0')
        show('film', 0.25)
        lines = shown(terminal, len(lines) + 3)
    assert lines[-1].startswith('diagnose: film:  25%|')


def test_nothing_is_shown_when_piped():
    pipe = io.StringIO()
    with redirect_stderr(pipe), Progress('plan', after_s=0.0) as show:
        show('film', 0.25)
    assert pipe.getvalue() == ''
