"""The journeys that `docs/architecture.md` lists run through the files in the order it gives."""

import re
import subprocess
import sys
import threading
from pathlib import Path

import pytest

import paint_deposition
from cli.command import COARSE, ran
from nodes.cell import two_passes

PACKAGE = Path(paint_deposition.__file__).parent
SAMPLES = PACKAGE.parent / 'samples'
DOOR = ('--mesh', SAMPLES / 'door.stl', '--trajectory', SAMPLES / 'door_horizontal', *COARSE)
STUDY = SAMPLES / 'panel_study/campaign.yaml'


@pytest.fixture
def entered():
    """Files of the package, in the order in which their functions are first called from now on."""
    found: dict[str, None] = {}
    package = f'{PACKAGE}/'

    def note(frame, event, _argument):
        file = frame.f_code.co_filename
        if event != 'call' or not file.startswith(package):
            return
        name = file.removeprefix(package)
        # What runs while a file is imported does not count.
        while frame and name not in found and '<frozen importlib' not in frame.f_code.co_filename:
            frame = frame.f_back
        if frame is None:
            found[name] = None

    threading.setprofile(note)
    sys.setprofile(note)
    yield found
    sys.setprofile(None)
    threading.setprofile(None)


def journey(repository: Path, name: str) -> list[str]:
    page = (repository / 'docs/architecture.md').read_text(encoding='utf-8')
    (row,) = re.findall(rf'^\| {re.escape(name)} \|(.*)\|$', page, re.MULTILINE)
    return re.findall(r'`(\S+)`', row)


def assert_passes(files: list[str], entered: dict[str, None]) -> None:
    assert [file for file in entered if file in files] == files


@pytest.mark.usefixtures('undrawn')
@pytest.mark.parametrize('words', [('simulate', *DOOR), ('improve', *DOOR), ('diagnose', STUDY)])
def test_a_command_passes_the_files_of_its_journey(words, entered, repository, tmp_path):
    ran(*words, '-o', tmp_path / 'results')
    assert_passes(journey(repository, f'`paint {words[0]}`'), entered)


def test_a_pose_passes_the_files_of_its_journey(entered, simulator, robot, wait_until, repository):
    node = simulator()
    entered.clear()
    robot(node).send(two_passes())
    wait_until(lambda: 'kernel/eq2_flux.py' in entered, what='painting')
    # The display looks for a new film all the time.
    entered.pop('nodes/painting/film_display.py', None)
    wait_until(lambda: 'nodes/painting/film_display.py' in entered, what='the display')
    assert_passes(journey(repository, 'a live pose'), entered)


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
