"""`paint line` on a folder of runs, with real processes and files."""

import json

import pyarrow.parquet as pq
import pytest

from cli.command import assert_refused, paint
from paint_deposition.batch.line.changes import date
from virtual_paint_shop.line import FIRST, Hidden, painted_job, write_line

STEP_AT, MINUTES = 7, 90.0


@pytest.mark.slow
def test_a_line_of_twelve_parts_with_a_step(tmp_path):
    job = painted_job(3, None, None, 12, 200_000)
    folder, output = tmp_path / 'line', tmp_path / 'out'
    hidden = Hidden(step_at=STEP_AT, step=0.85)
    names = write_line(job, folder, 12, hidden, minutes=MINUTES)
    (folder / f'{names[2]}.csv').unlink()
    (folder / f'{names[3]}.csv').write_text('x_m,y_m,z_m,thickness_um\n9,9,9,20\n')
    done = paint('line', folder, '-o', output, '--workers', 1, '--json')
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert (told['parts'], told['measured'], told['computed']) == (12, 10, 12)
    assert told['errors'] == []
    (remark,) = told['remarks']
    assert remark['part'] == names[3]
    assert remark['remark'].startswith(f'simulated only: {names[3]}.csv: ')
    assert f'warning: {names[3]}: simulated only: ' in done.stderr
    (change,) = told['changes']
    assert (change['series'], change['kind']) == ('level', 'step')
    assert change['time'] == date(FIRST.timestamp() + 60.0 * MINUTES * STEP_AT)
    assert change['after'] - change['before'] == pytest.approx(-15.0, abs=3.0 * change['sd'])
    points = pq.read_table(output / 'points.parquet').to_pylist()
    assert sum(row['measured_um'] is not None for row in points) == told['points'] == 120
    parts = pq.read_table(output / 'parts.parquet').to_pylist()
    assert [row['part'] for row in parts] == names
    assert [row['readings'] for row in parts] == [12, 12, 0, 0] + [12] * 8
    assert parts[1]['time'].timestamp() == FIRST.timestamp() + 60.0 * MINUTES
    assert parts[2]['film_mean_um'] == pytest.approx(parts[1]['film_mean_um'])
    assert change['sentence'].startswith('the film level (K1, or the gain of the gauge) fell by')
    assert {'level'} <= {name for alarm in told['alarms'] for name in alarm['series']}
    assert (output / 'line.png').stat().st_size > 10_000
    # A new day: only the new run is computed.
    (folder / f'{names[3]}.csv').unlink()
    again = json.loads(paint('line', folder, '-o', output, '--workers', 1, '--json').stdout)
    assert (again['computed'], again['parts'], again['remarks']) == (1, 12, [])


@pytest.mark.parametrize(
    ('files', 'words'),
    [
        ({}, ['has no line.yaml']),
        ({'line.yaml': 'mesh: a.stl'}, ['line.yaml', "has no 'model'"]),
        (
            {'line.yaml': 'mesh: a.stl\nmodel: m.yaml\npiont: p.csv'},
            ["unknown key 'piont'", "'points'"],
        ),
    ],
)
def test_a_folder_that_is_no_line_is_refused(tmp_path, files, words):
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    assert_refused(paint('line', tmp_path, '-o', tmp_path / 'out'), *words)
