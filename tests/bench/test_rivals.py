"""The oracle has the size and power that it must have; BIC finds what is plainly there."""

import numpy as np
import pytest
from benchmarks.rivals import Oracle, chosen_by_bic
from scipy.stats import ncx2

DRAWS = 4000


@pytest.fixture
def design():
    """60 readings of unequal noise, a pattern of four directions, a mark partly along them."""
    random = np.random.default_rng(1)
    sigma_um = random.uniform(0.5, 1.5, 60)
    pattern_um = random.normal(size=(60, 4))
    mark_um = random.normal(size=60) + pattern_um[:, 0]
    return sigma_um, pattern_um, mark_um


def p_values(design, amplitude):
    sigma_um, pattern_um, mark_um = design
    oracle = Oracle.of(sigma_um, 100.0 * pattern_um)
    random = np.random.default_rng(2)
    noise = sigma_um * random.normal(size=(DRAWS, 60))
    films = noise + 20.0 * random.normal(size=(DRAWS, 4)) @ pattern_um.T + amplitude * mark_um
    return np.array([oracle.p_value(film, mark_um) for film in films])


def test_the_strength_is_what_a_refitted_pattern_leaves_of_the_mark(design):
    sigma_um, pattern_um, mark_um = design
    whitened, rest = pattern_um / sigma_um[:, None], mark_um / sigma_um
    rest = rest - whitened @ np.linalg.lstsq(whitened, rest, rcond=None)[0]
    strength = Oracle.of(sigma_um, 1e4 * pattern_um).strength(mark_um)
    assert strength == pytest.approx(np.linalg.norm(rest), rel=1e-5)


def test_the_oracle_has_its_size_whatever_the_pattern(design):
    """Standard error 0.35 points."""
    p = p_values(design, 0.0)
    assert np.mean(p < 0.05) == pytest.approx(0.05, abs=0.011)
    assert np.mean(p < 0.5) == pytest.approx(0.5, abs=0.025)


def test_the_oracle_has_the_power_of_the_likelihood_ratio_test(design):
    sigma_um, pattern_um, mark_um = design
    strength = Oracle.of(sigma_um, 100.0 * pattern_um).strength(mark_um)
    amplitude = 2.0 / strength
    power = ncx2.sf(1.959964**2, 1, 4.0)
    assert np.mean(p_values(design, amplitude) < 0.05) == pytest.approx(power, abs=0.025)


def test_bic_chooses_what_is_there_and_stops(design):
    _, pattern, mark = design
    random = np.random.default_rng(4)
    others = [(f'other_{k}', random.normal(size=(60, 1))) for k in range(3)]
    marks = [*others, ('hidden', mark[:, None]), ('hidden', mark[:, None] ** 3)]
    noise = 0.01 * random.normal(size=60)
    assert chosen_by_bic(pattern, pattern @ np.ones(4) + 5.0 * mark + noise, marks)[0] == 'hidden'
    chosen = chosen_by_bic(pattern, pattern @ np.ones(4), marks)
    assert chosen == []
