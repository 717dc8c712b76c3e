"""The table of the loop of painting, measuring and planning again."""

from benchmarks.loop import table


def film(sigma_n: float, within: float = 0.5) -> dict:
    return {'mean_um': 20.0, 'sigma_n': sigma_n, 'within': within}


def record(seed: int, *sigmas: float, accepted: tuple[str, ...] = ()) -> dict:
    *turns, oracle = sigmas
    said = {'verdict': 'effect_missing', 'accepted': list(accepted)}
    return {
        'seed': seed, 'hidden': f'part {seed}', 'said': [said, said],
        'turns': [film(s) for s in turns], 'oracle': film(oracle),
    }  # fmt: skip


def test_the_share_is_that_of_the_gain_of_all_parts():
    text = table([record(1, 0.10, 0.06, 0.05, 0.05), record(2, 0.04, 0.04, 0.04, 0.04)])
    assert '80 % after one turn, 100 % after two' in text
    assert 'worse than before after one turn: 0 % of 2 parts' in text


def test_a_part_that_got_worse_is_counted():
    text = table([record(1, 0.10, 0.05, 0.05, 0.05), record(2, 0.04, 0.05, 0.04, 0.04)])
    assert 'worse than before after one turn: 50 % of 2 parts' in text
