"""Benchmarks keep what their workers found, and another run does the rest."""

import os

import pytest
from benchmarks.records import add, kept


def squared(task: tuple) -> list[dict]:
    number, times = task
    return [{'number': number, 'square': number**2, 'process': os.getpid()}] * times


@pytest.mark.slow
def test_records_of_workers_are_appended(tmp_path):
    results = tmp_path / 'runs' / 'records.jsonl'
    assert kept(results) == []
    first = add(results, squared, [(2, 1), (3, 2)], processes=2)
    assert sorted(record['square'] for record in first) == [4, 9, 9]
    assert os.getpid() not in {record['process'] for record in first}
    again = add(results, squared, [(4, 1)], processes=1)
    assert again[:3] == first == kept(results)[:3]
    assert again[3]['square'] == 16
