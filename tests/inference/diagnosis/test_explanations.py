"""What may be missing, and how far laws may be off."""

from dataclasses import replace

import numpy as np
import pytest

from booth import MODEL
from inference.diagnosis.linear import linear_fit
from inference.diagnosis.readings_on_door import on_door, on_panel, plate_with_a_back, study_of
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.files.effect_file import COVARIATES
from paint_deposition.inference.diagnosis import explanations
from paint_deposition.inference.fitting.least_squares import derivatives
from paint_deposition.inference.fitting.parameters import FreeParameters

EDGE = EFFECTS['edge_build'](gain=0.3, length_m=0.05)


@pytest.fixture(scope='module')
def study():
    return study_of(on_door())


def errors(
    study, *effects, kept: tuple[str, ...] | None = None, of=explanations.law_errors
) -> np.ndarray:
    """(P, n) of a model with these effects, of which all or some are kept.

    Its pattern is known exactly: it follows nothing.
    """
    model = MODEL.model_copy(update={'effects': effects})
    fit = linear_fit(np.random.default_rng(0), len(study))
    fit = replace(fit, model=model, jacobian=np.zeros_like(fit.jacobian))
    ids = [effect.id for effect in effects] if kept is None else kept
    return of(study, fit, frozenset(ids), fit.model)


def change_um(study, effect) -> np.ndarray:
    """(P,) what an effect adds to the readings [um]."""
    predict = study.forward.predict_um
    return predict(MODEL.with_effect(effect)) - predict(MODEL)


def another_form(*laws) -> np.ndarray:
    """(P, n) the last of the ways in which laws may be off."""
    return explanations.ways_off(*laws)[-1][0]


def size(columns: np.ndarray) -> np.ndarray:
    """(P,) standard deviation over the noise."""
    return np.linalg.norm(columns, axis=1)


@pytest.mark.parametrize(
    'effect', [EFFECTS['overspray_fog'](fog_um=3.0), EFFECTS['air_drift'](shift_down_m=0.02)]
)
def test_where_the_law_is_no_curve_each_reading_has_its_share_of_the_effect(study, effect):
    """Over the conditions that the effect names, over all others, and of a law of another form."""
    share = np.abs(change_um(study, effect)) / study.sigma_um
    expected = np.hypot(explanations.LAW_ERROR, explanations.OTHER_ERROR) * share
    assert size(errors(study, effect)) == pytest.approx(expected, rel=0.03)
    other_form = size(errors(study, effect, of=another_form))
    assert other_form == pytest.approx(explanations.OTHER_LAW * share, rel=0.03)


def test_over_conditions_of_others_what_the_pattern_would_follow_is_no_error_of_a_law(study):
    """Attraction by the incidence acts on all film, and shows little beside another pattern."""
    effect = EFFECTS['incidence_attraction'](attraction=0.8)
    fit = study.fit(FreeParameters.of(MODEL))
    jacobian = derivatives(study.forward, fit.parameters, fit.vector, study.sigma_um)
    fit = replace(fit, model=MODEL.with_effect(effect))
    change = change_um(study, effect) / study.sigma_um

    def variance(jacobian: np.ndarray) -> np.ndarray:
        pattern = replace(fit, jacobian=jacobian)
        errors = explanations.law_errors(study, pattern, frozenset([effect.id]), fit.model)
        return size(errors) ** 2

    followed_by_none = variance(np.zeros_like(jacobian))
    followed_wholly = variance(1e3 * change[:, np.newaxis] * np.eye(1, jacobian.shape[1]))
    over_others = (explanations.OTHER_ERROR * change) ** 2
    assert followed_by_none - followed_wholly == pytest.approx(over_others, rel=0.05)
    followed = np.sum(followed_by_none - variance(jacobian))
    assert 0.85 * np.sum(over_others) < followed < np.sum(over_others)


@pytest.mark.parametrize('effect', [e for e in EFFECTS.values() if e.exact], ids=lambda e: e.id)
def test_geometry_and_gauge_have_no_law_that_could_be_off(study, effect):
    nothing = (len(study), 0)
    for of in (explanations.law_errors, another_form):
        assert errors(study, effect.typical(), of=of).shape == nothing
    assert errors(study, effect.typical(), EDGE).shape == errors(study, EDGE).shape
    assert errors(study).shape == errors(study, EDGE, kept=()).shape == nothing
    assert not errors(study, type(EDGE)()).any()


def test_a_law_that_may_have_any_form_is_off_by_a_share_of_its_largest_effect(study):
    """Where it does least as much as where it does most: the law itself may be elsewhere."""
    change = change_um(study, EDGE)
    relative = change / study.forward.predict_um(MODEL.with_effect(EDGE))
    over_others = explanations.OTHER_ERROR * change / study.sigma_um
    own = np.sqrt(size(errors(study, EDGE)) ** 2 - (0.97 * over_others) ** 2)
    found = own * study.sigma_um / study.forward.predict_um(MODEL)
    assert found.max() < 1.2 * explanations.LAW_ERROR * np.abs(relative).max()
    assert found.min() > 0.5 * explanations.LAW_ERROR * np.quantile(np.abs(relative), 0.95)


def test_errors_of_several_effects_are_independent(study):
    fog = EFFECTS['fog_gradient'](fog_um=2.0)
    both, *each = (
        columns @ columns.T
        for kept in (None, ('fog_gradient',), ('edge_build',))
        for columns in [errors(study, fog, EDGE, kept=kept)]
    )
    np.testing.assert_allclose(both, sum(each), atol=1e-9 * both.max())


@pytest.fixture(scope='module')
def doors():
    """Two doors, the second painted without voltage."""
    off = on_door(switched_off=frozenset(['voltage']))
    return study_of(on_door(), replace(off, name='without voltage'))


def test_where_an_effect_was_off_or_no_paint_lands_its_law_has_no_error(doors):
    """On the back of a plate the model predicts exactly 0."""
    plate = study_of(plate_with_a_back())
    bare = plate.forward.predict_um(MODEL) == 0.0
    for study, none in ((doors, doors.campaign.experiment_of == 1), (plate, bare)):
        found = size(errors(study, EDGE))
        assert none.any()
        assert found[~none].max() > 0.05
        assert found[none] == pytest.approx(0.0)


def test_the_correction_of_a_law_acts_where_its_effect_does(doors):
    effect, off = EFFECTS['convex_attraction'](gain=0.3), doors.campaign.experiment_of == 1
    free = FreeParameters.of(model := MODEL.with_effect(effect))
    fit = doors.beside(free, free.encode(model))
    (curve,) = explanations.of_corrections(doors, fit, frozenset([effect.id]))
    assert size(curve.columns)[~off].max() > 0.1
    assert not curve.columns[off].any()
    law = curve.random.learned(np.ones(curve.columns.shape[1]))
    with_it = model.with_effect(law)
    more_um = doors.forward.predict_um(with_it) - doors.forward.predict_um(model)
    assert np.abs(more_um[~off]).max() > 0.1
    assert not more_um[off].any()
    assert with_it.without(frozenset(['voltage'])).effect(law.id).is_neutral


def test_laws_of_any_form_leave_the_film_as_a_whole_as_it_is(study):
    """How much paint there is in all is the pattern's."""
    # An effect of one's own may name any covariate of the readings, and no other.
    assert set(COVARIATES) == set(study.rays(MODEL)[0].along)
    fit = study.fit(FreeParameters.of(MODEL))
    laws = explanations.nonparametric_laws_of(study, MODEL)
    for found in (laws, explanations.of_footprint(study, fit)):
        assert sum(explanation.share for explanation in found) == pytest.approx(1.0)
        for explanation in found:
            assert explanation.cause == explanations.UNKNOWN
            assert explanation.learns not in ('', 'film_um')
            film_um = explanation.columns * study.sigma_um[:, np.newaxis]
            assert np.abs(film_um.sum(axis=0)).max() < 1e-9 * np.abs(film_um).sum()
            assert not explanation.sides.any()
    rows = np.arange(len(study)) % 2 == 0
    part = explanation.select(rows)
    assert (part.learns, part.random) == (explanation.learns, explanation.random)
    assert np.array_equal(part.columns, explanation.columns[rows])


def test_what_the_model_has_is_not_looked_for():
    study = study_of(on_panel())
    fit = replace(linear_fit(np.random.default_rng(0), len(study)), model=MODEL.with_effect(EDGE))
    others = ('corner_slowdown', 'fog_gradient')
    names = ('edge_build', *others)
    candidates = {name: explanations.neutral_shapes(EFFECTS[name]) for name in names}
    found = list(explanations.of_effects(study, fit, candidates))
    assert {explanation.cause for explanation in found} == set(others)
    for cause in others:
        own = [explanation for explanation in found if explanation.cause == cause]
        assert len(own) == len(candidates[cause])
        assert sum(explanation.share for explanation in own) == pytest.approx(1.0)
        assert all(e.law.id == cause and e.learns == '' for e in own)
