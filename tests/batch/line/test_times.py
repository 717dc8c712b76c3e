"""Parts whose recordings begin at one time."""

import pyarrow as pa
import pytest

from paint_deposition.batch.line.times import dated


@pytest.mark.parametrize(
    ('named', 'times', 'words'),
    [
        ([10.0, 20.0, 5.0], [10.0, 20.0, 7.0], '2 recordings begin at one time; dated by their'),
        (
            [10.0, None, 5.0],
            [3.0, 3.0, 7.0],
            'the order of their parts is not known; put the date',
        ),
        (
            [10.0, 10.0, 5.0],
            [3.0, 3.0, 7.0],
            'the order of their parts is not known; put the date',
        ),
    ],
)
def test_names_date_them_or_a_remark_says_that_nothing_does(named, times, words):
    columns = {
        'part': ['a', 'a', 'b', 'c', 'cut'], 'time_s': [3.0, 3.0, 3.0, 7.0, None],
        'named_s': [named[0], *named, None], 'remark': ['odd', 'odd', '', '', None],
    }  # fmt: skip
    rows = {row['part']: row for row in dated(pa.table(columns)).to_pylist()}
    assert [rows[part]['time_s'] for part in 'abc'] == times
    assert rows['a']['remark'].startswith('odd; 2 recordings begin at one time')
    assert words in rows['b']['remark']
    assert (rows['c']['remark'], rows['cut']['time_s']) == ('', None)
    assert 'named_s' not in rows['a']
