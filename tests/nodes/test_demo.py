"""The demo replaces nothing but an older demo."""

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.slow
def test_a_folder_that_is_no_demo_is_left_alone(repository: Path, tmp_path):
    (tmp_path / 'readings').mkdir()
    (tmp_path / 'readings/door.csv').write_text('years of work')
    command = [sys.executable, repository / 'demo/demo.py', tmp_path]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=100)
    assert (done.returncode, done.stdout) == (2, '')
    (line,) = done.stderr.splitlines()
    assert line.startswith(f'demo: {tmp_path} exists and is not from an older demo; ')
    assert (tmp_path / 'readings/door.csv').read_text() == 'years of work'
