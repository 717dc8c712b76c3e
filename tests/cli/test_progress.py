"""Progress as a terminal shows it."""

import io
import time
from contextlib import redirect_stderr

import pytest

from paint_deposition.cli import progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def terminal(monkeypatch):
    monkeypatch.setattr(progress, 'SHOW_PROGRESS_AFTER_S', 0.02)
    monkeypatch.setattr(progress, 'REDRAWN_EVERY_S', 0.02)
    return Terminal()


def shown(terminal: Terminal, count: int) -> list[str]:
    """What the line said, redrawn this often without another word from the work."""
    deadline = time.monotonic() + 20.0
    while terminal.getvalue().count('\r') < count and time.monotonic() < deadline:
        time.sleep(0.01)
    return [line.strip() for line in terminal.getvalue().split('\r') if line.strip()]


def test_the_clock_runs_within_a_step(terminal):
    with redirect_stderr(terminal), progress.Progress('diagnose') as tell:
        tell('fitting the pattern')
        lines = shown(terminal, 4)
    assert len(lines) >= 3
    assert set(lines) == {'diagnose: fitting the pattern [00:00]'}


def test_a_known_share_is_a_bar(terminal):
    with redirect_stderr(terminal), progress.Progress('plan') as tell:
        tell('film', 0.25)
        lines = shown(terminal, 2)
    assert lines[0].startswith('plan: film:  25%|')


def test_nothing_is_shown_when_piped(terminal, monkeypatch):
    monkeypatch.setattr(terminal, 'isatty', lambda: False)
    with redirect_stderr(terminal), progress.Progress('plan') as tell:
        tell('film', 0.25)
        time.sleep(0.1)
    assert terminal.getvalue() == ''
