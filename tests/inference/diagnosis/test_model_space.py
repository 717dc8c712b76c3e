"""The space of models: the test whether anything is missing, and which causes are."""

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import binom, kstest

from inference.diagnosis.linear import bounds, linear_fit, null_of, smooth_curves
from paint_deposition.effects.base import Effect
from paint_deposition.effects.learned.curves import CURVES
from paint_deposition.effects.library.air_drift import AirDrift
from paint_deposition.effects.library.corner_slowdown import CornerSlowdown
from paint_deposition.effects.library.edge_build import EdgeBuild
from paint_deposition.effects.library.faraday_shielding import FaradayShielding
from paint_deposition.effects.library.overspray_fog import OversprayFog
from paint_deposition.inference.diagnosis import model_space
from paint_deposition.inference.diagnosis.evidence import NullModel, simulated
from paint_deposition.inference.diagnosis.explanations import (
    FOOTPRINT,
    LAW_ERROR,
    LAW_SHARE,
    UNKNOWN,
    Explanation,
)
from paint_deposition.inference.diagnosis.model_space import (
    PRIOR,
    PRIOR_EFFECT,
    SIZES,
    SURE,
    ModelSpace,
)
from paint_deposition.inference.diagnosis.sensitivities import Sensitivity
from paint_deposition.inference.diagnosis.smooth_laws import NEGLIGIBLE, Basis, RandomLaw
from paint_deposition.inference.fitting.smooth_fields import field_over_values

READINGS = 60
NULL_RUNS = 400
# Probability that a correct p-value fails one of these bounds with other seeds.
CHANCE = 0.01


def law(effect: Effect, *columns, sides, errors=(), share=1.0) -> Explanation:
    """An effect by its law, with directions (P, n) for the error of the law."""
    stacked = np.column_stack(columns)
    of_law = Sensitivity(effect, type(effect).amplitudes(), stacked, *bounds(sides))
    both = np.hstack([stacked, *errors])
    free = np.zeros(both.shape[1] - stacked.shape[1])
    return Explanation(effect.id, both, np.append(of_law.sides, free), share, of_law)


def smooth(covariate: np.ndarray, length: float) -> np.ndarray:
    """(P, n) root of a random function of a covariate."""
    return field_over_values(covariate / covariate.std(), length, NEGLIGIBLE)


def field(cause: str, columns: np.ndarray, share: float = 1.0) -> Explanation:
    """A shapeless cause."""
    return Explanation(cause, columns, np.zeros(columns.shape[1]), share)


@pytest.fixture
def null() -> NullModel:
    """Readings of noise alone, with the seven parameters of the pattern fitted."""
    return null_of(linear_fit(np.random.default_rng(8), READINGS))


@pytest.fixture
def found() -> list[Explanation]:
    """Four effects, one in three shapes, one of two directions, and two shapeless causes."""
    random = np.random.default_rng(5)

    def direction(strength: float) -> np.ndarray:
        return strength * random.normal(size=READINGS)

    return [
        law(AirDrift(), direction(0.8), direction(0.8), sides=(0, 0)),
        *(
            law(CornerSlowdown(length_m=length), direction(0.9), sides=(1,), share=1.0 / 3.0)
            for length in (0.05, 0.1, 0.3)
        ),
        law(EdgeBuild(), direction(0.7), sides=(1,)),
        law(FaradayShielding(), direction(1.2), sides=(1,)),
        *(field(UNKNOWN, 0.3 * random.normal(size=(READINGS, 6)), 0.5) for _ in range(2)),
        field(FOOTPRINT, 0.3 * random.normal(size=(READINGS, 4))),
    ]


def shifted(null: NullModel, *changes: np.ndarray) -> NullModel:
    """The same noise on readings that these changes (P,), over the noise, have moved."""
    return NullModel.of(null.columns, null.raw + sum(changes))


def of_cause(found: list[Explanation], cause: str) -> list[Explanation]:
    return [explanation for explanation in found if explanation.cause == cause]


def space_of(null: NullModel, found: list[Explanation], freedom: float = np.inf) -> ModelSpace:
    return ModelSpace(null, found, freedom)


@pytest.mark.slow
def test_the_p_value_is_uniform_where_nothing_is_missing(null, found, monkeypatch):
    """With the noise known, and estimated with 15 degrees of freedom."""
    monkeypatch.setattr(model_space, 'DRAWS', 99)
    values = [
        space_of(
            NullModel(null.columns, null.lower @ deviation, null.lower, deviation),
            found,
            freedom,
        ).p_value(seed)
        for freedom in (np.inf, 15.0)
        for seed, deviation in enumerate(simulated(READINGS, freedom, NULL_RUNS, seed=11).T)
    ]
    assert kstest(values, 'uniform').pvalue > CHANCE
    for level in (0.01, 0.05, 0.2):
        alarms = np.count_nonzero(np.array(values) <= level)
        assert binom.ppf(CHANCE, len(values), level) <= alarms
        assert alarms <= binom.isf(CHANCE, len(values), level)
    # A test whose true size is 9 % would fail here.
    assert binom.sf(binom.isf(CHANCE, len(values), 0.05), len(values), 0.09) > 0.9


def test_a_planted_effect_is_found_with_its_shape(null, found):
    planted = of_cause(found, 'corner_slowdown')[1]
    space = space_of(shifted(null, 1.5 * planted.columns[:, 0]), found)
    assert space.p_value(seed=0) < 0.01
    assert space.inclusion('corner_slowdown') > 0.95
    ((cause, k, size),) = space.accepted
    assert cause == 'corner_slowdown'
    assert space.explanations[k].sensitivity is planted.sensitivity
    assert 0.7 <= size <= 2.8
    (amounts,) = space.amplitudes(space.models[0])
    assert amounts == pytest.approx([1.5], abs=0.35)


def test_nothing_is_included_where_nothing_acts(null, found):
    space = space_of(null, found)
    assert space.models[0].causes == ()
    assert space.accepted == []
    assert space.p_value(seed=0) > 0.05
    assert all(space.inclusion(cause) < 0.3 for cause in space.causes)


@pytest.mark.parametrize(
    'pair', [('edge_build', 'faraday_shielding'), ('air_drift', 'corner_slowdown')]
)
def test_two_effects_are_found_together(null, found, pair):
    changes = [1.5 * of_cause(found, cause)[0].columns[:, 0] for cause in pair]
    space = space_of(shifted(null, *changes), found)
    assert [cause for cause, _, _ in space.accepted] == sorted(pair)
    assert all(space.inclusion(cause) > 0.95 for cause in pair)


def test_three_effects_are_found_together(null, found):
    causes = ('air_drift', 'edge_build', 'faraday_shielding')
    changes = [1.5 * of_cause(found, cause)[0].columns[:, 0] for cause in causes]
    space = space_of(shifted(null, *changes), found)
    assert space.models[0].causes == causes
    assert {cause for cause, _, _ in space.accepted} == set(causes)


def test_two_effects_that_hide_one_another_are_found_together(null):
    """Each alone explains little: only the pair is seen."""
    random = np.random.default_rng(12)
    common = random.normal(size=READINGS)
    first, second = (3.0 * common + 0.6 * random.normal(size=READINGS) for _ in range(2))
    hidden = [
        law(EdgeBuild(), first, sides=(0,)),
        law(OversprayFog(), second, sides=(0,)),
        field(UNKNOWN, 0.3 * random.normal(size=(READINGS, 5))),
    ]
    space = space_of(shifted(null, 2.0 * (first - second)), hidden)
    assert space.models[0].causes == ('edge_build', 'overspray_fog')
    assert len(space.accepted) == 2


def test_the_wrong_sign_is_not_taken_for_an_effect(null, found):
    (faraday,) = of_cause(found, 'faraday_shielding')
    for sign, expected in ((1.0, True), (-1.0, False)):
        space = space_of(shifted(null, 1.5 * sign * faraday.columns[:, 0]), found)
        assert (space.inclusion('faraday_shielding') > 0.8) == expected
        assert (space.inclusion('faraday_shielding') < 0.05) != expected


def test_probabilities_are_those_of_all_sets_by_hand(null):
    """With one explanation a cause, each set's weight is its evidence at the best sizes."""
    random = np.random.default_rng(14)
    first, second = random.normal(size=(2, READINGS))
    causes = [law(EdgeBuild(), first, sides=(0,)), law(OversprayFog(), second, sides=(0,))]
    there = shifted(null, 0.5 * first)
    space = space_of(there, causes)
    white = [there.whiten(e.columns)[:, 0] for e in causes]
    odds = np.log(PRIOR_EFFECT / (1.0 - PRIOR_EFFECT))

    def evidence(*parts: tuple[np.ndarray, float]) -> float:
        covariance = np.eye(READINGS) + sum(s**2 * np.outer(w, w) for w, s in parts)
        y = there.deviation
        _, log_det = np.linalg.slogdet(covariance)
        return 0.5 * (y @ y - y @ np.linalg.solve(covariance, y) - log_det)

    weights = {(): 0.0}
    for explanation, column in zip(causes, white, strict=True):
        by_size = [evidence((column, size)) for size in SIZES]
        weights[(explanation.cause,)] = logsumexp(by_size) - np.log(len(SIZES)) + odds
    for model in space.models:
        if len(model.causes) < 2:
            assert model.log_weight == pytest.approx(weights[model.causes])
    assert {m.causes for m in space.models} == {*weights, ('edge_build', 'overspray_fog')}
    assert space.probabilities.sum() == pytest.approx(1.0)
    # A pair is weighed with the averaging over sizes that each has alone.
    (pair,) = (m for m in space.models if len(m.causes) == 2)
    grid = [
        evidence((white[0], a), (white[1], b)) + 2.0 * odds - 2.0 * np.log(len(SIZES))
        for a in SIZES
        for b in SIZES
    ]
    assert pair.log_weight == pytest.approx(logsumexp(grid), abs=0.3)
    assert space.against_nothing('edge_build') == pytest.approx(
        1.0 / (1.0 + np.exp(odds - weights[('edge_build',)]))
    )


def test_inclusion_does_not_depend_on_the_number_of_shapes(null, found):
    """The same law said ten times is no more probable than said once."""
    (edge,) = of_cause(found, 'edge_build')
    there = shifted(null, 0.8 * edge.columns[:, 0])
    others = [e for e in found if e.cause != 'edge_build']
    once = space_of(there, [*others, edge])
    copies = [law(EdgeBuild(), edge.columns[:, 0], sides=(1,), share=0.1) for _ in range(10)]
    many = space_of(there, [*others, *copies])
    assert 0.05 < once.inclusion('edge_build') < 0.999
    assert many.inclusion('edge_build') == pytest.approx(once.inclusion('edge_build'), abs=1e-6)
    assert many.p_value(seed=1) == once.p_value(seed=1)


@pytest.mark.parametrize('likeness', [1.0, 0.99])
def test_alternatives_hold_confounded_effects_and_sum_to_one(null, found, likeness):
    (edge,) = of_cause(found, 'edge_build')
    other = np.random.default_rng(15).normal(size=READINGS)
    twin = likeness * edge.columns[:, 0] + 0.7 * np.sqrt(1.0 - likeness**2) * other
    both = [*found, law(OversprayFog(), twin, sides=(1,))]
    space = space_of(shifted(null, 0.6 * (edge.columns[:, 0] + twin)), both)
    (one,) = (c for c in space.models[0].causes if c in ('edge_build', 'overspray_fog'))
    alternatives = space.alternatives(one)
    assert sum(alternatives.values()) == pytest.approx(1.0)
    assert next(iter(alternatives)) == one
    members, probability = space.group(one)
    assert set(members) == {'edge_build', 'overspray_fog'}
    assert probability == pytest.approx(space.inclusion(*members))
    assert probability > SURE
    # Neither is certain, but one of them is.
    if likeness == 1.0:
        assert max(space.inclusion(name) for name in members) < SURE
    assert [cause for cause, _, _ in space.accepted] == [one]


def test_an_effect_that_explains_alone_has_no_alternatives(null, found):
    (edge,) = of_cause(found, 'edge_build')
    space = space_of(shifted(null, 2.0 * edge.columns[:, 0]), found)
    members, probability = space.group('edge_build')
    assert members == ('edge_build',)
    assert probability > 0.95


def test_where_nothing_acts_alternatives_are_the_single_causes(null, found):
    space = space_of(null, found)
    alternatives = space.alternatives('edge_build')
    assert space.models[0].causes == ()
    assert set(alternatives) == set(space.causes)
    assert sum(alternatives.values()) == pytest.approx(1.0)
    members, probability = space.group('edge_build')
    assert 0.0 < probability < SURE
    assert set(members).isdisjoint(PRIOR)


def test_the_twin_of_a_cause_stands_in_its_place_and_not_beside_it(null, found):
    """Whichever of the two the best model has: each is an alternative of the other."""
    (edge,) = of_cause(found, 'edge_build')
    twin = law(OversprayFog(), 0.9 * edge.columns[:, 0], sides=(1,))
    space = space_of(shifted(null, 1.5 * edge.columns[:, 0]), [*found, twin])
    both = {'edge_build', 'overspray_fog'}
    assert len(both & set(space.models[0].causes)) == 1
    for cause in both:
        members, probability = space.group(cause)
        assert set(members) == both
        assert probability > SURE


def test_an_unknown_cause_is_no_effect(null, found):
    fields = of_cause(found, UNKNOWN)[0]
    change = 4.0 * fields.columns @ np.random.default_rng(16).normal(size=6)
    space = space_of(shifted(null, change), found)
    assert space.models[0].causes == (UNKNOWN,)
    assert space.accepted == []
    assert space.inclusion(UNKNOWN) > 0.95
    assert UNKNOWN not in space.group(UNKNOWN)[0]


def test_without_a_library_only_the_shapeless_is_weighed(null, found):
    space = space_of(null, [e for e in found if e.cause in PRIOR])
    assert set(space.causes) == {UNKNOWN, FOOTPRINT}
    assert 0.0 < space.p_value(seed=0) <= 1.0
    assert space.accepted == []


def test_fewer_readings_say_less(null, found):
    (edge,) = of_cause(found, 'edge_build')
    space = space_of(shifted(null, 0.8 * edge.columns[:, 0]), found)
    part = space.select(np.arange(READINGS) % 3 == 0)
    assert [e.cause for e in part.explanations] == [e.cause for e in space.explanations]
    assert part.causes == space.causes
    assert part.inclusion('edge_build') < space.inclusion('edge_build')
    whole = space.select(np.ones(READINGS, dtype=bool))
    assert whole.probabilities == pytest.approx(space.probabilities)


# Laws that are off, over a covariate that runs from -1 to 1.


def flat_null(count: int, change: np.ndarray, seed: int = 0) -> NullModel:
    """Unit noise and a free level, on readings that a change (P,) has moved."""
    noise = np.random.default_rng(seed).normal(size=count)
    return NullModel.of(3.0 * np.ones((count, 1)), noise + change)


def over(covariate: np.ndarray, form: np.ndarray) -> list[Explanation]:
    """An effect of this form (P,) with an error of its law, and shapeless fields."""
    root = smooth(covariate, 1.0)
    film = 3.0 * np.ones(len(covariate))
    return [
        law(EdgeBuild(), form, sides=(1,), errors=[LAW_ERROR * form[:, np.newaxis] * root]),
        law(OversprayFog(), np.ones_like(form) + 0.3 * covariate, sides=(1,)),
        field(UNKNOWN, film[:, np.newaxis] * smooth(covariate, 0.35), 0.5),
        field(UNKNOWN, film[:, np.newaxis] * smooth(covariate, 1.0), 0.5),
    ]


@pytest.mark.parametrize('count', [40, 160, 640])
def test_an_effect_whose_law_is_off_stays_that_effect_however_many_the_readings(count):
    covariate = np.random.default_rng(count).uniform(-1.0, 1.0, count)
    form = 10.0 * np.exp(-1.5 * (covariate + 1.0))
    true = form * (1.0 + 0.2 * np.sin(2.5 * covariate))
    found = over(covariate, form)
    space = space_of(flat_null(count, 1.5 * true), found)
    assert [cause for cause, _, _ in space.accepted] == ['edge_build']
    assert space.inclusion('edge_build') > 0.95
    # Without an error of its own the law loses as soon as the readings show the difference.
    exact = [law(EdgeBuild(), form, sides=(1,)), *found[1:]]
    rigid = space_of(flat_null(count, 1.5 * true), exact)
    if count == 640:
        assert rigid.models[0].causes != ('edge_build',)


def test_what_is_far_from_the_law_is_not_its_error():
    """A wave that needs more of an error than of the law is no such effect."""
    covariate = np.random.default_rng(3).uniform(-1.0, 1.0, 200)
    form = 4.0 * np.exp(-1.5 * (covariate + 1.0))
    space = space_of(flat_null(200, 1.5 * form * np.sin(6.0 * covariate)), over(covariate, form))
    assert 'edge_build' not in space.models[0].causes
    assert UNKNOWN in space.models[0].causes


def any_curve(
    cause: str, covariate: np.ndarray, length: float, directions: tuple[int, ...], share: float
) -> Explanation:
    """Smooth curves over the covariate, which an effect owns that goes in these directions."""
    random = smooth_curves(4.0 * (covariate + 1.0), 9, length)
    columns = random.change_um
    free = np.zeros(columns.shape[1])
    return Explanation(cause, columns, free, share, random=random, directions=directions)


RISEN = pytest.mark.parametrize(
    ('direction', 'accepted'), [(1, True), (-1, False), (0, True)], ids=['up', 'down', 'either']
)


@RISEN
def test_a_free_law_must_go_in_the_direction_of_its_effect(direction, accepted):
    covariate = np.random.default_rng(4).uniform(-1.0, 1.0, 120)
    risen = 3.0 * (covariate + 0.3 * covariate**2)
    wrong_law = law(EdgeBuild(), np.cos(9.0 * covariate), sides=(1,), share=LAW_SHARE)
    found = [
        wrong_law,
        any_curve('edge_build', covariate, 2.0, (direction,), 1.0 - LAW_SHARE),
        field(UNKNOWN, smooth(covariate, 0.35)),
    ]
    space = space_of(flat_null(120, risen), found)
    assert (space.inclusion('edge_build') > SURE) == accepted
    assert ([cause for cause, _, _ in space.accepted] == ['edge_build']) == accepted
    if accepted:
        ((_, k, _),) = space.accepted
        assert space.explanations[k].random is not None
        (amounts,) = space.amplitudes(space.models[0])
        rise = np.diff(space.explanations[k].random.at_knots @ amounts).sum()
        assert rise == pytest.approx(6.0, abs=1.5)


@pytest.mark.parametrize(
    ('form', 'cause'),
    [(lambda x: 3.0 * x, 'edge_build'), (lambda x: 3.0 * np.sin(8.0 * x), UNKNOWN)],
    ids=['rises', 'waves'],
)
def test_an_unknown_curve_that_goes_the_way_of_an_effect_is_that_effect(form, cause):
    """Both may have any curve over the covariate: which way it goes decides."""
    covariate = np.random.default_rng(4).uniform(-1.0, 1.0, 120)
    found = [
        law(EdgeBuild(), np.cos(9.0 * covariate), sides=(1,), share=LAW_SHARE),
        any_curve('edge_build', covariate, 0.35, (1,), 1.0 - LAW_SHARE),
        any_curve(UNKNOWN, covariate, 0.35, (1,), 1.0),
    ]
    space = space_of(flat_null(120, form(covariate)), found)
    assert space.models[0].causes == (cause,)
    assert space.inclusion(cause) > 0.9
    # Nobody owns the covariate: the curve may be anything, and unknown causes are more frequent.
    free = [*found[:2], any_curve(UNKNOWN, covariate, 0.35, (), 1.0)]
    assert space_of(flat_null(120, form(covariate)), free).inclusion(UNKNOWN) > 0.4


@pytest.mark.parametrize(
    ('curve', 'directions', 'right'),
    [
        ([0.0, 1.0, 2.0], (1,), True),
        ([0.0, 1.0, 2.0], (-1,), False),
        ([2.0, 1.0, 0.0], (-1,), True),
        ([2.0, 1.0, 0.0], (1, -1), True),
        ([0.0, 1.0, 0.9], (1,), True),
        ([0.0, 1.0, 0.0], (1,), False),
        ([0.0, 1.0, 0.0], (0,), False),
        ([0.0, 1.0, 0.0], (), True),
        ([1.0, 1.0, 1.0], (1,), True),
        ([2.0, 1.0, 0.0], (0,), True),
    ],
)
def test_which_way_a_curve_goes(curve, directions, right):
    basis = Basis(CURVES['height_fraction'], {}, np.eye(3), np.arange(3.0)[:, np.newaxis], 1.0)
    for cause, expected in (('edge_build', right), (UNKNOWN, not right or not directions)):
        explanation = Explanation(
            cause, np.eye(3), np.zeros(3), 1.0,
            random=RandomLaw(basis, np.eye(3)), directions=directions,
        )  # fmt: skip
        assert explanation.goes_right(np.array(curve)) == expected
