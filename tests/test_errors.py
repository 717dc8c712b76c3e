"""The remedy for a name that is not known."""

import pytest

from paint_deposition.errors import did_you_mean


@pytest.mark.parametrize(
    ('name', 'remedy'),
    [
        ('sigma_1_m', "did you mean 'sigma1_m'?"),
        ('K1', "did you mean 'K1_cm3_per_s'?"),  # not K2, which is nearer letter by letter
        (1, 'there are: K1_cm3_per_s, K2, sigma1_m'),
        ('verbose', 'there are: K1_cm3_per_s, K2, sigma1_m'),
    ],
)
def test_an_unknown_name_is_answered_with_the_nearest_or_with_all(name, remedy):
    assert did_you_mean(name, ['K1_cm3_per_s', 'K2', 'sigma1_m']) == remedy
    # Where nothing is known that is said.
    assert did_you_mean('speed', []) == 'there are: none'
    assert did_you_mean('speed', [], 'give a column') == 'give a column'
