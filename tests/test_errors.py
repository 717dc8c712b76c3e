"""The remedy for a name that is not known; most are told where files and commands are refused."""

from paint_deposition.errors import did_you_mean


def test_a_name_that_is_no_word_is_answered_with_all_and_where_none_is_known_that_is_said():
    assert did_you_mean(1, ['K1_cm3_per_s', 'K2']) == 'there are: K1_cm3_per_s, K2'
    assert did_you_mean('speed', []) == 'there are: none'
    assert did_you_mean('speed', [], 'give a column') == 'give a column'
