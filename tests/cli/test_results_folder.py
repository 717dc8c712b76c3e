"""A folder of results holds those of one command, whole."""

import os
import signal
import subprocess
import sys
import tempfile
from contextlib import suppress
from multiprocessing import get_context
from tempfile import mkdtemp

import pytest

from cli.command import paint
from paint_deposition.cli.results import MARKER, results_in
from paint_deposition.errors import PaintError
from paint_deposition.files.provenance import sha256


def write(folder, *names: str) -> None:
    """Results of a command, each with its own name as content."""
    with results_in(folder) as work:
        for name in names:
            (work / name).parent.mkdir(exist_ok=True)
            (work / name).write_text(name)


def names_in(folder) -> list[str]:
    return sorted(path.name for path in folder.iterdir() if path.name != MARKER)


def test_results_of_an_earlier_command_go_and_files_of_others_stay(tmp_path):
    out = tmp_path / 'new' / 'out'
    write(out, 'film.csv', 'trajectory/bag.mcap', 'stats.json')
    (out / 'notes.txt').write_text('mine')
    write(out, 'model.yaml', 'stats.json')
    assert names_in(out) == ['model.yaml', 'notes.txt', 'stats.json']
    write(out, 'trajectory/bag.mcap')
    write(out, 'trajectory/metadata.yaml')
    assert names_in(out) == ['notes.txt', 'trajectory']
    assert names_in(out / 'trajectory') == ['metadata.yaml']
    assert names_in(tmp_path / 'new') == ['out']


@pytest.mark.parametrize('name', ['model.yaml', 'trajectory/mine.csv', '.paint_work/mine.csv'])
def test_files_and_folders_of_the_users_own_are_not_replaced(tmp_path, name):
    mine = tmp_path / name
    mine.parent.mkdir(exist_ok=True)
    mine.write_text('mine')
    with pytest.raises(PaintError, match=r'was not written by paint.*; move it'):
        write(tmp_path, 'trajectory/bag.mcap', 'model.yaml', 'plan.json')
    assert [path for path in tmp_path.rglob('*') if path.is_file()] == [mine]
    assert mine.read_text() == 'mine'


def test_a_marker_names_nothing_outside_its_folder(tmp_path):
    write(tmp_path / 'other', 'film.csv')
    (tmp_path / 'mine.txt').write_text('mine')
    for line in ('..', '.', '', '../mine.txt', '../other', f'/{tmp_path}', 'a/../../mine.txt'):
        write(tmp_path / 'out', 'film.csv')
        with (tmp_path / 'out' / MARKER).open('a') as marker:
            marker.write(f'{sha256(tmp_path / "mine.txt")}  {line}\n')
        write(tmp_path / 'out', 'model.yaml')
        assert names_in(tmp_path / 'out') == ['model.yaml'], line
        assert names_in(tmp_path) == ['mine.txt', 'other', 'out']
        assert names_in(tmp_path / 'other') == ['film.csv']


@pytest.mark.parametrize('name', ['notes', 'notes/readings.csv', 'link'])
def test_what_a_marker_names_is_no_leave_for_a_folder_or_a_link(tmp_path, name):
    """A file goes only as a command wrote it, and never through a link."""
    tree = tmp_path / 'mine' if name == 'link' else tmp_path / 'out/notes'
    write(tmp_path / 'out', 'film.csv')
    tree.mkdir()
    (tree / 'readings.csv').write_text('another')
    if name == 'link':
        (tmp_path / 'out/link').symlink_to(tree)
    with (tmp_path / 'out' / MARKER).open('a') as marker:
        marker.write(f'{sha256(tree / "readings.csv")}  {name}\n')
    (tree / 'readings.csv').write_text('mine')
    write(tmp_path / 'out', 'model.yaml')
    assert not (tmp_path / 'out/film.csv').exists()
    assert (tree / 'readings.csv').read_text() == 'mine'


def end_at_a_call(folder, end: str, call: int) -> None:
    """Write results; end at this call of those that change the folder, or with code 3."""
    left = [call]

    def counted(function):
        def called(*args, **more):
            left[0] -= 1
            if left[0] == 0:
                if end == 'kill':
                    os.kill(os.getpid(), signal.SIGKILL)
                raise OSError(28, 'full')
            return function(*args, **more)

        return called

    with results_in(folder) as work:
        (work / 'trajectory').mkdir()
        for name in ('film.csv', 'stats.json', 'trajectory/bag.mcap'):
            (work / name).write_text('new')
        for name in ('rename', 'replace', 'mkdir'):
            setattr(os, name, counted(getattr(os, name)))
    sys.exit(3 if left[0] > 0 else 0)


@pytest.mark.parametrize('end', ['kill', 'full'])
@pytest.mark.parametrize('others', [True, False], ids=['among_other_files', 'alone'])
def test_results_are_the_old_or_the_new_wherever_a_command_ends(tmp_path, end, others):
    states = set()
    for call in range(1, 40):
        out = tmp_path / str(call) / 'out'
        write(out, 'film.csv', 'old.csv', 'trajectory/bag.mcap', 'trajectory/old.yaml')
        if others:
            (out / 'notes.txt').write_text('mine')
        command = get_context('fork').Process(target=end_at_a_call, args=(out, end, call))
        command.start()
        command.join()
        if end == 'kill' and command.exitcode < 0:  # the next puts right what this one left
            with suppress(KeyboardInterrupt), results_in(out) as work:
                (work / 'film.csv').write_text('half')
                raise KeyboardInterrupt
        held = tuple(sorted(p.relative_to(out).as_posix() for p in out.rglob('*')))
        assert names_in(out.parent) == ['out']
        assert ('notes.txt' in held) == others
        is_new = (out / 'film.csv').read_text() == 'new'
        states.add((is_new, held))
        if command.exitcode == 3:  # all calls were made
            break
    assert command.exitcode == 3
    assert {is_new for is_new, _ in states} == {True, False}
    assert len(states) == 2, states


def test_commands_on_one_folder_take_turns(tmp_path):
    results = [[f'{name}{k}' for k in range(5)] for name in 'abc']

    def write_often(names: list[str]) -> None:
        tempfile.tempdir = mkdtemp(dir=tmp_path)  # as each container and user has its own
        for _ in range(40):
            write(tmp_path / 'out', *names)

    running = [get_context('fork').Process(target=write_often, args=[each]) for each in results]
    for command in running:
        command.start()
    for command in running:
        command.join()
    assert [command.exitcode for command in running] == [0, 0, 0]
    assert names_in(tmp_path / 'out') in results


@pytest.mark.parametrize('number', [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_a_signal_ends_a_command_like_an_interrupt_and_nothing_is_left(tmp_path, number):
    code = """
import signal, sys
from pathlib import Path
from paint_deposition.cli import main
from paint_deposition.cli.results import results_in
# As at a terminal: for what runs in the background a shell ignores the one, nohup the other.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)
def work(context):
    with results_in(Path(sys.argv[1])) as folder:
        (folder / 'half').touch()
        print('writing', flush=True)
        signal.pause()
main.paint.invoke = work
main.main()
"""
    words = [sys.executable, '-c', code, str(tmp_path / 'out')]
    running = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    running.stdout.readline()
    running.send_signal(number)
    _, errors = running.communicate()
    assert (running.returncode, errors) == (130, '\npaint: interrupted\n')
    assert names_in(tmp_path) == []


def test_the_working_directory_may_be_the_folder_of_two_commands(tmp_path):
    inode = os.stat(tmp_path).st_ino
    write(tmp_path, 'film.csv', 'film.png')
    for _ in range(2):
        assert paint('recommend', '--speed', 0.3, '-o', '.', cwd=tmp_path).returncode == 0
    assert names_in(tmp_path) == ['recommendation.json', 'uniformity.png']
    assert os.stat(tmp_path).st_ino == inode
