"""The demo replaces nothing but an older demo."""

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip('rclpy')


def demo(repository: Path, *arguments: object) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, repository / 'demo/demo.py', *map(str, arguments)],
        capture_output=True, text=True, check=False, timeout=100,
    )  # fmt: skip


@pytest.mark.slow
def test_a_folder_that_is_no_demo_is_left_alone(repository, tmp_path):
    (tmp_path / 'readings').mkdir()
    (tmp_path / 'readings/door.csv').write_text('years of work')
    for target in (tmp_path, tmp_path / 'readings', tmp_path / 'readings/door.csv'):
        done = demo(repository, target)
        assert done.returncode == 2
        assert done.stdout == ''
        (line,) = done.stderr.splitlines()
        assert line.startswith(f'demo: {target} exists and is not from an older demo; ')
    assert (tmp_path / 'readings/door.csv').read_text() == 'years of work'


def test_it_asks_for_a_folder(repository):
    done = demo(repository)
    assert (done.returncode, done.stderr) == (2, 'demo: give one folder for the results\n')


def test_an_older_demo_and_an_empty_folder_are_taken(repository, tmp_path):
    script = (
        f'import sys; sys.path.insert(0, {str(repository / "demo")!r})\n'
        'from pathlib import Path; from demo import fresh_folder\n'
        f'folder = fresh_folder(Path({str(tmp_path)!r}))\n'
        "(folder / 'older.csv').write_text('')\n"
        "assert not (fresh_folder(folder) / 'older.csv').exists()\n"
        "fresh_folder(folder / 'new/one')\n"
    )
    subprocess.run([sys.executable, '-c', script], check=True, timeout=100)
    assert (tmp_path / 'new/one').is_dir()
