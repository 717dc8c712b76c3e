"""Work for many processes: what fails is told and tried again, and the rest is computed."""

import pytest

from paint_deposition.batch.cases import Case, ResultCache
from paint_deposition.batch.processes import compute

FILM = "{'mean_um': [20.0]}"


@pytest.mark.slow
def test_a_case_that_fails_says_so_and_is_tried_again(tmp_path):
    """`eval` is the work: of columns, of what raises, of what ends its process."""
    texts = {'deadly': "__import__('os')._exit(1)", 'good': FILM, 'bad': '1 / 0', 'last': FILM}
    cases = [Case(name, text, known={'part': [name]}) for name, text in texts.items()]
    finished = ResultCache(tmp_path)
    assert compute(eval, cases, {}, finished, lambda what, share: None, 2) == 4
    deadly, good, bad, last = finished.table(texts).to_pylist()
    assert (good['mean_um'], good['error']) == (last['mean_um'], last['error']) == (20.0, None)
    assert (bad['part'], bad['mean_um']) == ('bad', None)
    assert bad['error'] == 'not computed: ZeroDivisionError: division by zero'
    assert deadly['error'].startswith('not computed: its process ended')
    assert [name for name in texts if finished.has(name)] == ['good', 'last']
