"""The command `paint` as a process."""

import os
import subprocess
import sys
from pathlib import Path

SOURCES = Path(__file__).resolve().parents[2] / 'ros2_ws/src/paint_deposition'
COMMAND = [sys.executable, '-m', 'paint_deposition.cli.main']


def environment() -> dict[str, str]:
    """That of the tests, with the package's sources on the path."""
    path = os.pathsep.join([str(SOURCES), os.environ.get('PYTHONPATH', '')])
    return os.environ | {'PYTHONPATH': path}


def paint(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess:
    """Run `paint` with these arguments to its end."""
    return subprocess.run(
        [*COMMAND, *map(str, arguments)],
        capture_output=True,
        text=True,
        cwd=cwd,
        env=environment(),
        check=False,
        timeout=100,
    )


def assert_refused(done: subprocess.CompletedProcess, *words: str) -> None:
    """Exit code 2, nothing on stdout, one line on stderr with these words in it."""
    assert done.returncode == 2, done.stderr
    assert done.stdout == ''
    lines = done.stderr.splitlines()
    assert len(lines) == 1, done.stderr
    assert lines[0].startswith('paint: ')
    for word in words:
        assert word in lines[0], lines[0]
