"""The tables of the bench of measuring points, on results made by hand."""

from benchmarks.measure import diagnosis_table, power_table


def power(count: int, **by_way: float) -> dict:
    return {'count': count, 'power': by_way}


def test_readings_saved_are_read_off_the_curves():
    """A grid needs twice the points, on a logarithmic scale; random points never suffice."""
    lines = power_table([
        power(20, chosen=0.3, grid=0.1, random=0.1),
        power(40, chosen=0.4, grid=0.3, random=0.2),
        power(160, chosen=0.6, grid=0.5, random=0.3),
    ])  # fmt: skip
    assert (
        lines[-2]
        == 'as much as with 40 chosen points takes 80 on a grid: 50 % of the readings saved'
    )
    assert lines[-1].startswith('as much as with 40 chosen points takes more than 160 at random')
    assert 'over 75 %' in lines[-1]


def test_detections_are_counted_by_way():
    yes, no = {'detected': True, 'named': True}, {'detected': True, 'named': False}
    said = {'chosen': yes, 'grid': no, 'random': {'detected': False, 'named': False}}
    lines = diagnosis_table([{'said': said}, {'said': said}])
    assert lines[1].split() == ['chosen', '2', 'of', '2', '2', 'of', '2']
    assert lines[2].split() == ['grid', '2', 'of', '2', '0', 'of', '2']
    assert lines[3].split() == ['random', '0', 'of', '2', '0', 'of', '2']
