"""A folder of results holds those of one command, whole."""

import os

import pytest

from cli.command import paint
from paint_deposition.cli.results_folder import MARKER, results_in
from paint_deposition.errors import PaintError


def write(folder, *names: str) -> None:
    """Results of a command, each with its own name as content."""
    with results_in(folder) as work:
        for name in names:
            (work / name).parent.mkdir(exist_ok=True)
            (work / name).write_text(name)


def write_half(folder, error) -> None:
    """Results of a command that ends before its second file."""
    with results_in(folder) as work:
        (work / 'film.csv').write_text('half')
        raise error


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


@pytest.mark.parametrize('error', [KeyboardInterrupt, OSError('disk full')])
def test_what_is_interrupted_leaves_the_folder_as_it_was(tmp_path, error):
    write(tmp_path / 'out', 'film.csv', 'film.png')
    for folder in (tmp_path / 'out', tmp_path / 'other'):
        with pytest.raises((KeyboardInterrupt, OSError)):
            write_half(folder, error)
    assert names_in(tmp_path) == ['out']
    assert names_in(tmp_path / 'out') == ['film.csv', 'film.png']
    assert (tmp_path / 'out/film.csv').read_text() == 'film.csv'


def test_a_folder_that_no_command_made_is_not_replaced(tmp_path):
    (tmp_path / 'out/trajectory').mkdir(parents=True)
    (tmp_path / 'out/trajectory/mine.csv').write_text('mine')
    with pytest.raises(PaintError, match='not written by paint; move it away'):
        write(tmp_path / 'out', 'trajectory/bag.mcap', 'plan.json')
    assert names_in(tmp_path / 'out') == ['trajectory']
    assert names_in(tmp_path / 'out/trajectory') == ['mine.csv']


def test_a_marker_names_nothing_outside_its_folder(tmp_path):
    write(tmp_path / 'out', 'film.csv')
    (tmp_path / 'mine.txt').write_text('mine')
    (tmp_path / 'out' / MARKER).write_text('../mine.txt\nfilm.csv\n')
    write(tmp_path / 'out', 'model.yaml')
    assert names_in(tmp_path / 'out') == ['model.yaml']
    assert (tmp_path / 'mine.txt').exists()


def test_the_working_directory_may_be_the_folder_of_two_commands(tmp_path):
    inode = os.stat(tmp_path).st_ino
    write(tmp_path, 'film.csv', 'film.png')
    for _ in range(2):
        assert paint('recommend', '--speed', 0.3, cwd=tmp_path).returncode == 0
    assert names_in(tmp_path) == ['recommendation.json', 'uniformity.png']
    assert os.stat(tmp_path).st_ino == inode
