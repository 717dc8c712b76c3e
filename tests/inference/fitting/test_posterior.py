"""What one job told, as the prior of the next, and models drawn from it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, kstest, truncnorm

import paint_deposition as pd
from inference.diagnosis.linear import KNOWN, PARAMETERS, correlated, linear_fit
from inference.fitting.panels import painted_by, passes
from paint_deposition.effects.library.corner_slowdown import CornerSlowdown
from paint_deposition.errors import ModelError
from paint_deposition.inference.fitting import posterior as jobs
from paint_deposition.inference.fitting.estimates import scaled_covariance
from paint_deposition.inference.fitting.parameters import FreeParameters, Posterior
from paint_deposition.inference.fitting.posterior import (
    PatternShift,
    draw_models,
    posterior_of,
    with_mean_level,
)
from paint_deposition.model.eq1_pattern import EFFECT_BETWEEN_JOBS, PATTERN

WITH_EFFECT = FreeParameters.of(pd.DepositionModel(), CornerSlowdown(gain=0.5, length_m=0.2))


@pytest.fixture(scope='module')
def campaign() -> pd.Campaign:
    grid = np.array([[0.1 * k, 0.0, 1.0] for k in range(-3, 4)])
    return pd.Campaign((painted_by(pd.DepositionModel(), passes([1.0]), grid),))


def thicker(panel, **settings) -> pd.Campaign:
    """Another job, painted at other settings."""
    taken = replace(panel.taken, thickness_um=panel.taken.thickness_um + 0.01)
    return pd.Campaign((replace(panel, taken=taken, settings=settings),))


@pytest.mark.parametrize('parameters', [PARAMETERS, WITH_EFFECT], ids=['pattern', 'effect'])
def test_the_posterior_of_a_job_is_the_prior_of_the_next_widened(parameters, campaign):
    """There and back through the coordinates of the file, shapes of effects included."""
    fit = linear_fit(np.random.default_rng(1), 60, parameters=parameters)
    fit = replace(fit, vector=np.clip(fit.vector, *parameters.bounds))
    prior = replace(parameters, known=posterior_of(fit, campaign)).prior
    between = [c.between_jobs for c in PATTERN]
    between += [EFFECT_BETWEEN_JOBS] * (len(parameters) - len(PATTERN))
    assert prior.centre == pytest.approx(fit.vector)
    widened = scaled_covariance(fit, with_mean_level(fit, campaign))
    widened += np.diag(np.square(between))
    assert prior.factor @ prior.factor.T == pytest.approx(widened, rel=1e-6, abs=1e-12)


def test_effects_are_told_in_their_own_units_and_the_unknown_keeps_its_weak_prior(campaign):
    fit = linear_fit(np.random.default_rng(2), 60, parameters=WITH_EFFECT)
    vector = WITH_EFFECT.encode(WITH_EFFECT.start)
    told = posterior_of(replace(fit, vector=vector), campaign).mean
    assert told['corner_slowdown.gain'] == pytest.approx(0.5)
    assert np.exp(told['corner_slowdown.log_length_m']) == pytest.approx(0.2)
    assert np.exp(told['log_K1']) == pytest.approx(pd.DepositionModel().planar.K1_cm3_per_s)
    both = replace(WITH_EFFECT, known=correlated(PARAMETERS)).prior
    alone = KNOWN.prior
    count = len(PATTERN)
    assert both.factor[:count, :count] == pytest.approx(alone.factor)
    assert both.centre[count:] == pytest.approx(WITH_EFFECT.weak_prior.centre[count:])
    assert both.factor[count:, count:] == pytest.approx(np.eye(len(WITH_EFFECT) - count))
    assert not both.factor[count:, :count].any()


def test_no_reading_counts_twice_and_other_settings_of_the_process_are_told(campaign):
    (panel,) = campaign.experiments
    fit = linear_fit(np.random.default_rng(4), 60)
    posterior = posterior_of(fit, campaign)
    assert posterior.readings == (panel.taken.fingerprint,)
    known, remarks = jobs.prior_for(posterior, campaign)
    assert known is None
    assert 'panel' in remarks[0]
    other = thicker(panel)
    assert jobs.prior_for(posterior, other) == (posterior, ())
    assert jobs.prior_for(None, campaign) == (None, ())
    later = replace(fit, parameters=replace(fit.parameters, known=posterior))
    (added,) = (part.taken.fingerprint for part in other.experiments)
    assert posterior_of(later, other).readings == (*posterior.readings, added)
    calibrated = pd.Campaign((replace(panel, settings={'voltage_kv': 60.0, 'flow': 1.0}),))
    posterior = posterior_of(linear_fit(np.random.default_rng(4), 60), calibrated)
    assert posterior.process == {'voltage_kv': 60.0, 'flow': 1.0}
    known, (remark,) = jobs.prior_for(posterior, thicker(panel, voltage_kv=0.0, flow=1.01))
    assert known == posterior
    assert 'calibrated at voltage_kv 60, this job was painted at 0:' in remark
    for settings in ({'voltage_kv': 61.0}, {}):
        assert jobs.prior_for(posterior, thicker(panel, **settings)) == (posterior, ())


def test_jobs_that_differ_as_assumed_are_as_far_as_told():
    fit, prior = linear_fit(np.random.default_rng(0), 20, parameters=KNOWN), KNOWN.prior

    def moved_by(away: np.ndarray) -> PatternShift:
        """By this vector from the centre of what was known."""
        return PatternShift.of(replace(fit, vector=prior.centre + away))

    draws = np.random.default_rng(1).normal(size=(500, len(PATTERN)))
    shifts = [moved_by(prior.factor @ draw) for draw in draws]
    squares = np.array([shift.distance for shift in shifts]) ** 2
    assert kstest(squares, chi2(len(PATTERN)).cdf).pvalue > 0.01
    first = np.array([shift.by_coordinate['log_K1'] for shift in shifts])
    assert kstest(first, 'norm').pvalue > 0.01
    assert np.mean(np.sqrt(squares) < shifts[0].usual) == pytest.approx(0.95, abs=0.03)
    assert sum(shift.is_alarming for shift in shifts) <= 5
    # A bell of another kind is warned of by what differs most.
    other = moved_by(8.0 * prior.width[4] * (np.arange(len(PATTERN)) == 4))
    assert other.is_alarming
    assert 'most in r_m (+8.0)' in other.warning
    assert other.to_dict()['by_coordinate']['r_m'] == pytest.approx(8.0)


COUNT = 4000
GAIN = 'corner_slowdown.gain'
MODEL = pd.DepositionModel(effects=(CornerSlowdown(gain=0.1, length_m=0.1),))


def known(means: dict[str, float], deviations: dict[str, float]) -> Posterior:
    """Of a well known pattern but for these coordinates, all independent."""
    centres = {c.name: c.centre for c in PATTERN} | {GAIN: 0.1} | means
    rows = np.diag([deviations.get(name, 1e-4) ** 2 for name in centres])
    return Posterior(mean=centres, covariance=dict(zip(centres, rows.tolist(), strict=True)))


def test_draws_near_a_bound_follow_the_truncated_normal_and_none_is_beyond():
    """The mean of what is left of the normal, not that of one whose tail lies at the bound."""
    posterior = known({'K2': 0.05, GAIN: 0.1}, {'K2': 0.1, GAIN: 0.3})
    models = draw_models(MODEL, posterior, COUNT, seed=1)
    k2 = np.array([model.planar.K2 for model in models])
    gain = np.array([model.effect('corner_slowdown').gain for model in models])
    low, high = (CornerSlowdown.parameters()['gain'][end] for end in ('low', 'high'))
    for values, mean, sd, ends in ((k2, 0.05, 0.1, (0.0, 1.0)), (gain, 0.1, 0.3, (low, high))):
        told = truncnorm(*((end - mean) / sd for end in ends), loc=mean, scale=sd)
        assert len(np.unique(values)) == COUNT
        assert values.mean() == pytest.approx(told.mean(), abs=4.0 * told.std() / COUNT**0.5)
        assert values.std() == pytest.approx(told.std(), rel=4.0 / (2 * COUNT) ** 0.5)
    # Each is within its bounds, or refused.
    wide = known({'K3_cos_phi': 0.7}, {'K3_cos_phi': 0.3, 'K3_sin_phi': 0.6})
    asymmetry = np.array([model.planar.K3 for model in draw_models(MODEL, wide, COUNT, seed=2)])
    assert len(np.unique(asymmetry)) == COUNT
    assert asymmetry.max() <= 1.0
    with pytest.raises(ModelError, match='posterior: of 1000 draws 0 are within the bounds'):
        draw_models(MODEL, known({'K2': -0.5}, {'K2': 0.01}), 1, seed=3)
