"""`paint runs`, where there is little to list."""

from cli.command import assert_refused, paint


def test_a_folder_without_runs_is_told(tmp_path):
    (tmp_path / 'notes').mkdir()
    assert_refused(paint('runs', tmp_path), f'{tmp_path} holds no run', 'change_part')
    assert_refused(paint('runs', tmp_path / 'none'), 'none is no folder; give the output_dir')


def test_a_film_that_cannot_be_understood_is_named(tmp_path):
    (tmp_path / '4711').mkdir()
    (tmp_path / '4711/film.json').write_text('{"part": 3}')
    assert_refused(paint('runs', tmp_path), '4711: film.json or metadata.yaml cannot be')


def test_a_run_that_was_not_finished_is_told(tmp_path):
    (tmp_path / '4711').mkdir()
    (tmp_path / '4711/4711_0.mcap').write_bytes(b'')
    (row,) = paint('runs', tmp_path).stdout.splitlines()[1:]
    assert row.split() == ['4711', '-', '1', *'----------', 'unfinished']
