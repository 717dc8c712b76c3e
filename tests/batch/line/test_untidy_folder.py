"""A folder of runs that is not tidy: each oddity in a line, nothing guessed, the rest computed."""

import json
import shutil

import pyarrow.parquet as pq
import pytest

from cli.command import assert_refused, paint
from paint_deposition.batch.line.runs import line_cases
from virtual_paint_shop.line import Hidden, painted_job, write_line


@pytest.fixture(scope='module')
def tidy(tmp_path_factory):
    """Five runs with their readings; returns the folder and the names of the runs."""
    folder = tmp_path_factory.mktemp('tidy') / 'line'
    job = painted_job(3, None, None, 12, 200_000)
    return folder, write_line(job, folder, 5, Hidden())


@pytest.fixture
def line(tidy, tmp_path):
    folder, names = tidy
    return shutil.copytree(folder, tmp_path / 'line'), names


@pytest.mark.slow
def test_each_oddity_is_told_and_the_rest_is_computed(line, tmp_path):
    folder, names = line
    cut, twice, gauge, label, good = names
    (recording,) = (folder / cut).glob('*.mcap')
    recording.write_bytes(recording.read_bytes()[:3000])
    (folder / cut / 'metadata.yaml').unlink()
    shutil.copy(next((folder / twice).glob('*.mcap')), folder / f'{twice}.mcap')
    shutil.copy(folder / f'{gauge}.csv', folder / f'{gauge}.txt')
    (folder / f'{label}.csv').rename(folder / f'{label}.CSV')
    (folder / 'unknown_door.csv').write_text('x_m,y_m,z_m,thickness_um\n0,0,0,20\n')
    (folder / 'empty').mkdir()
    (folder / 'week_46').mkdir()
    shutil.copytree(folder / good, folder / 'week_46' / good)
    done = paint('line', folder, '-o', tmp_path / 'out', '--workers', 1, '--json')
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert [error['run'] for error in told['errors']] == [cut, twice, 'week_46/']
    assert 'paint recover' in told['errors'][0]['error']
    assert 'two recordings have its name' in told['errors'][1]['error']
    assert 'move them up beside line.yaml' in told['errors'][2]['error']
    remarks = {one['part']: one['remark'] for one in told['remarks']}
    assert remarks[gauge].startswith('simulated only: two files of readings have its name')
    assert told['without_run'] == ['unknown_door.csv']
    assert told['warnings'] == ['no recording has the name of unknown_door.csv; left out']
    assert (told['parts'], told['measured'], told['points']) == (3, 2, 24)
    for words in (*told['without_run'], *(one['run'] for one in told['errors']), *remarks):
        assert sum(words in text for text in done.stderr.splitlines()) == 1
    rows = pq.read_table(tmp_path / 'out/points.parquet').to_pylist()
    kept = {name: sum(row['part'] == name for row in rows) for name in (gauge, label, good)}
    assert kept == {gauge: 1, label: 12, good: 12}


def test_a_run_is_another_case_when_its_readings_have_changed(line):
    folder, names = line
    before = [case.digest for case in line_cases(folder)[0]]
    with (folder / f'{names[0]}.csv').open('a') as file:
        file.write('\n')
    after = [case.digest for case in line_cases(folder)[0]]
    assert [a != b for a, b in zip(before, after, strict=True)] == [True, *[False] * 4]


@pytest.mark.slow
def test_a_line_without_any_run_that_can_be_used_says_why(line, tmp_path):
    folder, names = line
    (folder / 'door.stl').write_text('solid nothing\nendsolid nothing\n')
    done = paint('line', folder, '-o', tmp_path / 'out', '--workers', 1)
    assert_refused(done, 'none of 5 runs can be used', names[0], 'door.stl')


def test_an_empty_folder_is_refused(tidy, tmp_path):
    for name in ('line.yaml', 'model.yaml', 'door.stl'):
        shutil.copy(tidy[0] / name, tmp_path)
    assert_refused(paint('line', tmp_path, '-o', tmp_path / 'out'), 'holds no run', 'rosbag2')
