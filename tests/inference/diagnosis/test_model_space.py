"""The evidence beside one model: whether anything is missing, what, and what would be seen."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import binom, kstest, multivariate_t

from inference.diagnosis import linear
from inference.diagnosis.linear import law, unknown
from paint_deposition.effects.learned_laws import LearnedFootprint
from paint_deposition.inference.diagnosis import model_space, testability
from paint_deposition.inference.diagnosis.discrepancy import PRIOR, Footprints, ModelDiscrepancy
from paint_deposition.inference.diagnosis.discrepancy import DiscrepancyHyperparameters as Sizes
from paint_deposition.inference.diagnosis.explanations import UNKNOWN, Explanation
from paint_deposition.inference.diagnosis.gaussian import NullModel, simulated
from paint_deposition.inference.diagnosis.model_space import ModelSpace, WeightedNull
from paint_deposition.inference.diagnosis.smooth_laws import Basis, RandomLaw
from paint_deposition.inference.fitting.random_effects import smooth

READINGS, NULL_RUNS, POWER_RUNS = 60, 300, 200
# Probability that a correct p-value or power fails one of these bounds with other seeds.
CHANCE = 0.01
# Places along a part, and the film over the noise.
PLACE, FILM = np.linspace(0.0, 3.0, READINGS), 40.0
SMALL, USUAL, LARGE, BEYOND = (
    Sizes(share, 0.0, 1, 2, 0.0) for share in (0.006, PRIOR.most_usual, 0.06, PRIOR.beyond_nature)
)
# A change that neighbours share, and one that they do not.
WAVE = np.sin(2.0 * PLACE)
JAGGED = 0.7 * np.random.default_rng(2).normal(size=READINGS)
LENGTHS_M = (0.05, 0.1, 0.3)
# Sizes of the footprint, over the largest.
SHARES = (0.1, 0.3, 1.0)


@pytest.fixture
def discrepancy() -> ModelDiscrepancy:
    """Smooth fields along the part, and one deviation of the footprint, but nothing else."""
    away = np.abs(np.subtract.outer(PLACE, PLACE))
    fields = tuple(FILM**2 * smooth(away / length) for length in (0.1, 0.5, 1.0))
    footprint = np.random.default_rng(6).normal(size=(READINGS, 1))
    unseen = np.empty((0, 1))
    basis = Basis(LearnedFootprint, {}, unseen, unseen.T, 1.0)
    columns = tuple(size * footprint for size in SHARES)
    laws = tuple(RandomLaw(basis, 0.1 * size * np.eye(1)) for size in SHARES)
    footprints = Footprints(columns, laws, radius_m=np.zeros(1), flux=np.ones(1))
    rest = 3 * (np.zeros_like(away),), False, (0.02, 0.05, 0.1)
    return ModelDiscrepancy(linear.MODEL, footprints, fields, *rest)


@pytest.fixture
def plain() -> NullModel:
    """Readings of noise alone, with the seven parameters of the pattern fitted."""
    return linear.null_of(linear.linear_fit(np.random.default_rng(8), READINGS))


@pytest.fixture
def found() -> list[Explanation]:
    """Four effects, one in three shapes, one of two directions, and two laws of any form."""
    random = np.random.default_rng(5)

    def direction(strength: float) -> np.ndarray:
        return strength * random.normal(size=READINGS)

    return [
        law('tcp_offset', direction(0.8), direction(0.8), side=0),
        *(law('corner_slowdown', direction(0.9), share=1 / 3, length_m=x) for x in LENGTHS_M),
        law('edge_build', direction(0.7)),
        law('faraday_shielding', direction(1.2)),
        *(unknown(0.3 * random.normal(size=(READINGS, 6)), 0.5) for _ in range(2)),
    ]


def shifted(null: NullModel, change: np.ndarray) -> NullModel:
    """The same noise on readings that a change (P,), over the noise, has moved."""
    return NullModel.of(null.columns, null.scaled_deviation + change)


def space_of(
    plain: NullModel, found: list[Explanation], discrepancy: ModelDiscrepancy, *sizes: Sizes,
    freedom: float = np.inf,
) -> ModelSpace:  # fmt: skip
    weighed = [WeightedNull.of(plain, discrepancy, one, freedom) for one in sizes or (SMALL,)]
    return ModelSpace(weighed, found, discrepancy, freedom)


def probability(space: ModelSpace, cause: str) -> float:
    """That a cause acts, if one acts at the most."""
    return np.exp(space.alone[cause] - logsumexp([0.0, *space.alone.values()]))


def drawn_spaces(plain, found, discrepancy, of, known, freedom=np.inf) -> list[ModelSpace]:
    """Of readings that a discrepancy of one size made, at the sizes that are known."""
    null = plain.with_discrepancy(discrepancy.covariance(of))
    draws = null.lower @ simulated(READINGS, freedom, NULL_RUNS, seed=11)
    nulls = (NullModel.of(plain.columns, raw) for raw in draws.T)
    return [space_of(one, found, discrepancy, *known, freedom=freedom) for one in nulls]


@pytest.fixture
def few_draws(monkeypatch):
    monkeypatch.setattr(model_space, 'DRAWS', 99)


@pytest.mark.slow
@pytest.mark.parametrize(('size', 'freedom'), [(SMALL, np.inf), (LARGE, 15.0)])
@pytest.mark.usefixtures('few_draws')
def test_the_p_value_is_uniform_where_nothing_is_missing(plain, found, discrepancy, freedom, size):
    def p_values(*known: Sizes) -> np.ndarray:
        spaces = drawn_spaces(plain, found, discrepancy, size, known, freedom)
        return np.array([space.p_value(seed) for seed, space in enumerate(spaces)])

    assert kstest(p_values(size), 'uniform').pvalue > CHANCE
    # Where the size is not known either, alarms are at most as frequent as they may be.
    values = p_values(SMALL, LARGE, BEYOND)
    for level in (0.01, 0.05, 0.2):
        assert np.count_nonzero(values <= level) <= binom.isf(CHANCE, NULL_RUNS, level)


@pytest.mark.slow
def test_sprays_that_differ_more_than_usual_ones_are_told(plain, discrepancy, few_draws):
    """Whatever size is the most probable: what is usual is where alarms have their rate."""
    sizes, alarms = (SMALL, USUAL, LARGE), []
    for of in sizes:
        spaces = drawn_spaces(plain, [], discrepancy, of, sizes)
        values = [space.p_value_of_size(seed) for seed, space in enumerate(spaces)]
        alarms.append(np.count_nonzero(np.array(values) <= 0.05))
    small, usual, large = alarms
    assert small <= usual <= binom.isf(CHANCE, NULL_RUNS, 0.05)
    assert large > 0.7 * NULL_RUNS


def test_one_point_far_off_is_told_where_the_fields_are_usual(plain, discrepancy):
    far = shifted(plain, np.where(np.arange(READINGS) == READINGS // 2, 9.0, 0.0))
    off, nothing = (space_of(null, [], discrepancy, USUAL) for null in (far, plain))
    assert off.p_values(seed=0)[1] < 0.05 < nothing.p_values(seed=0)[1]


@pytest.mark.parametrize('freedom', [np.inf, 12.0])
def test_odds_are_those_of_densities_averaged_over_sizes_and_shapes(plain, discrepancy, freedom):
    """What differs by more than nature's settings do counts as unknown."""
    shapes = [law('edge_build', c, side=0, share=0.5) for c in (JAGGED, JAGGED + WAVE)]
    shapeless = unknown(np.stack([WAVE, JAGGED], axis=1))
    there = shifted(plain, 0.5 * JAGGED)
    sizes = [replace(SMALL, log_prior=-1.0), replace(LARGE, log_prior=-0.5), BEYOND]
    space = space_of(there, [*shapes, shapeless], discrepancy, *sizes, freedom=freedom)

    def density(one: Sizes, columns: np.ndarray) -> float:
        null = plain.with_discrepancy(discrepancy.covariance(one) + columns @ columns.T)
        of = multivariate_t(shape=null.lower @ null.lower.T, df=freedom)
        return float(of.logpdf(there.scaled_deviation)) + one.log_prior

    none = np.zeros((READINGS, 1))
    nothing = logsumexp([density(one, none) for one in sizes[:2]])

    def odds(*explanations: Explanation) -> float:
        averaged = [
            np.log(e.share / len(model_space.SIZES)) + density(one, s * e.columns)
            for e in explanations for one in sizes[:2] for s in model_space.SIZES
        ]  # fmt: skip
        return logsumexp(averaged) - nothing

    half = model_space.log_odds(model_space.PRIOR_UNKNOWN) - np.log(2.0)
    of_edge = odds(*shapes) + model_space.log_odds(model_space.PRIOR_EFFECT)
    of_unknown = np.logaddexp(odds(shapeless), density(BEYOND, none) - nothing) + half
    assert space.alone == pytest.approx({'edge_build': of_edge, UNKNOWN: of_unknown})


def test_a_planted_effect_is_proposed_with_its_shape_and_amplitude(plain, found, discrepancy):
    nothing = space_of(plain, found, discrepancy, SMALL, LARGE, BEYOND)
    assert nothing.p_value(seed=0) > 0.05
    assert all(probability(nothing, cause) < 0.3 for cause in nothing.alone)
    planted = found[2]
    space = space_of(shifted(plain, 1.5 * planted.columns[:, 0]), found, discrepancy)
    assert space.p_value(seed=0) < 0.01
    assert next(iter(space.alone)) == 'corner_slowdown'
    assert probability(space, 'corner_slowdown') > 0.95
    effect = space.by_law('corner_slowdown')
    assert effect.length_m == planted.law.length_m
    typical = type(effect).parameters()['gain']['typical']
    assert effect.gain / typical == pytest.approx(1.5, abs=0.35)


def test_a_setting_that_differs_by_more_than_natures_do_is_unknown(plain, discrepancy):
    """Even if nothing is looked for."""
    random = np.random.default_rng(3).normal(size=READINGS)
    beyond = np.linalg.cholesky(discrepancy.settings[1] + 1e-6 * np.eye(READINGS)) @ random
    there = shifted(plain, PRIOR.beyond_nature * beyond)
    space, nothing = (space_of(null, [], discrepancy, SMALL, BEYOND) for null in (there, plain))
    assert probability(space, UNKNOWN) > 0.95
    assert space.p_value(seed=0) < 0.01
    assert probability(nothing, UNKNOWN) < 0.05


@pytest.mark.parametrize(('form', 'hidden'), [(WAVE, True), (JAGGED, False)], ids=['wave', 'not'])
def test_what_nature_may_leave_over_is_no_effect(plain, discrepancy, form, hidden):
    """A large discrepancy swallows a smooth change, and none that neighbours do not share."""
    there, edge = shifted(plain, 2.0 * form), law('edge_build', 2.0 * form)
    small, large = (space_of(there, [edge], discrepancy, size) for size in (SMALL, LARGE))
    assert small.p_value(seed=0) < 0.01
    assert probability(small, 'edge_build') > 0.95
    assert (large.p_value(seed=0) > 0.05) == hidden
    assert (probability(large, 'edge_build') < 0.2) == hidden


def test_the_size_that_made_the_readings_is_found(plain, discrepancy):
    random = np.random.default_rng(4)
    for true, other in ((SMALL, LARGE), (LARGE, SMALL)):
        null = plain.with_discrepancy(discrepancy.covariance(true))
        there = NullModel.of(plain.columns, null.lower @ random.normal(size=READINGS))
        space = space_of(there, [], discrepancy, SMALL, LARGE)
        assert space.share.sum() == pytest.approx(1.0)
        assert space.share[[SMALL, LARGE].index(true)] > 0.9
        assert space.central.null.lower == pytest.approx(null.lower)
        assert abs(space.figures.setting_share - true.setting) < 0.1 * LARGE.setting
        kept = model_space.probable_hyperparameters(there, discrepancy, [], np.inf)
        shares = [size.setting for size in kept if not size.is_beyond_nature]
        assert true.setting in shares
        assert other.setting not in shares


def test_the_deviation_of_the_footprint_is_told(plain, discrepancy):
    columns = tuple(3.0 * column for column in discrepancy.footprint.columns)
    loud = replace(discrepancy, footprint=replace(discrepancy.footprint, columns=columns))
    there = shifted(plain, 2.0 * columns[SMALL.footprint][:, 0])
    figures = space_of(there, [], loud).figures
    assert figures.footprint_of_peak == pytest.approx(0.2, abs=0.02)
    assert figures.profile.found - figures.profile.eq1 == pytest.approx(0.2, abs=0.02)
    assert 0.0 < figures.profile.sd < 0.02
    assert figures.length_m == discrepancy.lengths_m[SMALL.length]
    assert 'the footprint differs from eq. (1) by 20 % of its peak' in str(figures)
    assert 'parts painted alike' not in str(figures)
    # What does not show is not spoken of: a law that is learned may show it all the same.
    assert 'footprint' not in str(replace(figures, footprint_of_peak=0.0))


def test_sizes_that_matter_only_beside_an_effect_are_kept(plain, discrepancy):
    """A strong effect that is smooth looks like a large discrepancy as long as it is missing."""
    there, edge = shifted(plain, 6.0 * WAVE), law('edge_build', 6.0 * WAVE)
    kept_of = model_space.probable_hyperparameters
    without, with_it = (kept_of(there, discrepancy, e, np.inf) for e in ([], [edge]))
    for kept in (without, with_it):
        beyond = [size.is_beyond_nature for size in kept]
        assert {size.footprint for size in kept} == set(range(len(SHARES)))
        assert beyond.count(False) <= model_space.MOST_SIZES * len(SHARES)
        assert beyond.count(True) == len(SHARES)
    assert min(s.setting for s in with_it) < min(s.setting for s in without)
    usual = [size for size in without if not size.is_beyond_nature]
    weights = [WeightedNull.of(there, discrepancy, s, np.inf).log_weight for s in usual]
    assert min(np.exp(weights - logsumexp(weights))) > model_space.LEAST_SHARE


@pytest.mark.slow
@pytest.mark.parametrize('freedom', [np.inf, 12.0])
def test_a_detectable_amplitude_is_detected_nine_times_in_ten(freedom, plain, found, monkeypatch):
    """Through the test that the diagnosis makes, on readings that the effect has moved."""
    monkeypatch.setattr(model_space, 'DRAWS', 500)
    space = model_space.EffectEvidence(plain, found, freedom)
    _, detectable = testability.testability(space, seed=3)
    limit = np.quantile(space.evidence(space.null_draws(3)), 1.0 - testability.LEVEL)
    noise = simulated(READINGS, freedom, POWER_RUNS, seed=6)
    for explanation in found[4:6]:
        effect, (name,) = explanation.cause, explanation.law.amplitudes()
        typical = explanation.law.parameters()[name]['typical']
        change = detectable[effect][name] / typical * plain.whiten(explanation.columns)
        seen = np.count_nonzero(space.evidence(noise + change) > limit)
        low, high = binom.interval(1.0 - CHANCE, POWER_RUNS, testability.POWER)
        assert low <= seen <= high, effect


def test_what_nature_leaves_over_or_hides_in_the_pattern_is_less_testable(plain, found):
    def detectable_gain(null: NullModel) -> float:
        space = model_space.EffectEvidence(null, found, np.inf)
        _, detectable = testability.testability(space, seed=3)
        return detectable['edge_build']['gain']

    along = found[4].columns
    beside = plain.with_discrepancy(4.0 * along @ along.T)
    assert detectable_gain(beside) > 1.3 * detectable_gain(plain)
    # A direction that the pattern takes up whole shows nothing, however strong.
    hidden = plain.columns[:, 0] / np.linalg.norm(plain.columns[:, 0])
    space = model_space.EffectEvidence(plain, [law('edge_build', hidden)], np.inf)
    assert testability.testability(space, seed=0) == (('edge_build',), {})
