"""Linear algebra of small matrices runs on one thread, and only while a fit runs."""

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import paint_deposition as pd


class Seen(Exception):
    """Enough was seen."""


def blas_threads() -> set[int]:
    return {pool['num_threads'] for pool in threadpool_info() if pool['user_api'] == 'blas'}


@pytest.mark.parametrize(
    'fit',
    [pd.calibrate, pd.diagnose, lambda sample, **told: pd.refit(sample, None, **told)],
    ids=['calibrate', 'diagnose', 'refit'],
)
def test_a_fit_has_one_thread_and_gives_the_others_back(fit, sample):
    def look(line: str) -> None:
        raise Seen(blas_threads())

    with threadpool_limits(2, 'blas'):
        assert blas_threads() == {2}
        with pytest.raises(Seen, match=r'^\{1\}$'):
            fit(sample, progress=look)
        assert blas_threads() == {2}
