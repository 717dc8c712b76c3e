"""The command `paint`, in this process as a rule and as a process where that is the point."""

import io
import subprocess
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest

from paint_deposition.cli.main import run


def paint(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess:
    """Run `paint` with these arguments in this process: all but its start and its end."""
    words = [str(argument) for argument in arguments]
    output, errors = io.StringIO(), io.StringIO()
    with (
        pytest.MonkeyPatch.context() as place,
        redirect_stdout(output),
        redirect_stderr(errors),
    ):
        place.chdir(cwd or Path.cwd())
        code = run(words)
    return subprocess.CompletedProcess(words, code, output.getvalue(), errors.getvalue())


def installed_paint(*arguments: object) -> subprocess.CompletedProcess:
    """Run the installed `paint` with these arguments as a process of its own."""
    command = ['paint', *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def assert_refused(done: subprocess.CompletedProcess, *words: str) -> None:
    """Exit code 2, nothing on stdout, one line on stderr with these words in it."""
    assert done.returncode == 2, done.stderr
    assert done.stdout == ''
    lines = done.stderr.splitlines()
    assert len(lines) == 1, done.stderr
    assert lines[0].startswith('paint: ')
    for word in words:
        assert word in lines[0], lines[0]
