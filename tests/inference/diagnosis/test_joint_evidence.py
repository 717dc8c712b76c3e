"""Evidence of sets of explanations against densities, and the search against trying all."""

from itertools import combinations, product

import numpy as np
import pytest
from paint_deposition.inference.diagnosis.joint_evidence import (
    NEVER,
    Directions,
    log_evidence,
    refine,
)
from scipy.stats import multivariate_normal, multivariate_t, norm

from paint_deposition.inference.diagnosis.evidence import Principal

READINGS = 12
SIZES = np.array([0.5, 1.0, 3.0])
# Two explanations of three causes each; one has more directions than there are readings.
WIDTHS = (2, 5, 1, 3, 14, 4)
FIRST, LAST = np.array([0, 2, 4]), np.array([2, 4, 6])


@pytest.fixture
def deviation() -> np.ndarray:
    return 2.0 * np.random.default_rng(1).normal(size=READINGS)


@pytest.fixture
def columns() -> list[np.ndarray]:
    random = np.random.default_rng(2)
    return [random.normal(size=(READINGS, width)) for width in WIDTHS]


def directions(columns, deviation, freedom=np.inf, sides=None) -> Directions:
    """With ``sides``, one (n,) for each explanation; default: no sign is known."""
    sides = sides or [np.zeros(c.shape[1]) for c in columns]
    found = [Principal.of(c, s) for c, s in zip(columns, sides, strict=True)]
    return Directions.of(found, deviation, freedom)


def log_density(freedom: float, deviation: np.ndarray, covariance: np.ndarray) -> float:
    if np.isfinite(freedom):
        return multivariate_t.logpdf(deviation, shape=covariance, df=freedom)
    return multivariate_normal.logpdf(deviation, cov=covariance)


@pytest.mark.parametrize('freedom', [np.inf, 7.0])
def test_the_evidence_of_a_set_is_a_ratio_of_densities(columns, deviation, freedom):
    """Of every set of one, two and three explanations, at two sets of sizes."""
    together = directions(columns, deviation, freedom)
    for count in (1, 2, 3):
        sizes = np.array([[0.3, 1.0, 2.5], [2.0, 0.1, 0.7]])[:, :count]
        for chosen in combinations(range(len(WIDTHS)), count):
            found = log_evidence(together, np.array(chosen), sizes)
            for value, scale in zip(found, sizes, strict=True):
                covariance = np.eye(READINGS) + sum(
                    s**2 * columns[k] @ columns[k].T for k, s in zip(chosen, scale, strict=True)
                )
                expected = log_density(freedom, deviation, covariance)
                expected -= log_density(freedom, deviation, np.eye(READINGS))
                assert value == pytest.approx(expected, rel=1e-8, abs=1e-8)


@pytest.mark.parametrize('chosen', [(1,), (1, 3), (0, 1, 4), (4, 3, 1)])
def test_a_known_sign_counts_by_its_posterior_probability(columns, deviation, chosen):
    """Wherever in the set the explanation stands, and whether or not it is the widest."""
    sides = [np.zeros(c.shape[1]) for c in columns]
    sides[1][:2], sides[3][0], sides[4][3] = (1.0, -1.0), 1.0, -1.0
    sizes = np.array([[0.5, 1.5, 0.8]])[:, : len(chosen)]
    numbers = np.array(chosen)
    (free,) = log_evidence(directions(columns, deviation), numbers, sizes)
    (signed,) = log_evidence(directions(columns, deviation, sides=sides), numbers, sizes)
    scaled = np.hstack([s * columns[k] for k, s in zip(chosen, sizes[0], strict=True)])
    covariance = np.linalg.inv(np.eye(scaled.shape[1]) + scaled.T @ scaled)
    ratio = covariance @ scaled.T @ deviation / np.sqrt(np.diag(covariance))
    side = np.concatenate([sides[k] for k in chosen])
    known = side != 0.0
    probabilities = norm.logcdf(side[known] * ratio[known])
    assert signed - free == pytest.approx(np.sum(np.log(2.0) + probabilities), rel=1e-8)


@pytest.mark.parametrize('seed', range(5))
def test_refining_ends_where_no_single_change_is_better(columns, seed):
    """Of all explanations and sizes of each cause, but those that contradict physics."""
    random = np.random.default_rng(seed)
    moved = sum(c @ random.normal(size=c.shape[1]) for c in columns[::2])
    together = directions(columns, moved + random.normal(size=READINGS))
    log_share = np.log(random.uniform(0.1, 1.0, len(WIDTHS)))[:, np.newaxis].repeat(3, axis=1)
    log_share[1, 1:] = NEVER
    chosen, sizes = FIRST.copy(), np.ones(3)
    refine(together, log_share, FIRST, LAST, SIZES, chosen, sizes, 20)

    def value(numbers, scale) -> float:
        found = log_evidence(together, np.array(numbers), np.array([scale]))[0]
        return found + sum(log_share[k].max() for k in numbers)

    best = value(chosen, sizes)
    for member, size in product(range(3), enumerate(SIZES)):
        for k in range(FIRST[member], LAST[member]):
            if log_share[k, size[0]] > NEVER:
                numbers, scale = chosen.copy(), sizes.copy()
                numbers[member], scale[member] = k, size[1]
                assert value(numbers, scale) <= best + 1e-9
