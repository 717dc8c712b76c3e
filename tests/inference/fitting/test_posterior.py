"""What one job told, as the prior of the next."""

from dataclasses import replace

import numpy as np
import pytest

from inference.diagnosis.linear import KNOWN, PARAMETERS, correlated, fit_linear, linear_fit
from inference.fitting.panels import painted_by, passes
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.library.corner_slowdown import CornerSlowdown
from paint_deposition.inference.fitting.estimates import scaled_covariance
from paint_deposition.inference.fitting.parameters import FreeParameters
from paint_deposition.inference.fitting.posterior import fingerprints, posterior_of, usable
from paint_deposition.inference.readings.campaign import Campaign
from paint_deposition.model.coordinates import EFFECT_BETWEEN_JOBS, PATTERN

WITH_EFFECT = FreeParameters.of(DepositionModel(), CornerSlowdown(gain=0.5, length_m=0.2))


@pytest.fixture(scope='module')
def campaign():
    grid = np.array([[0.1 * k, 0.0, 1.0] for k in range(-3, 4)])
    part = painted_by(DepositionModel(), passes([1.0]), grid)
    return Campaign((replace(part, name='panel'),))


@pytest.mark.parametrize('parameters', [PARAMETERS, WITH_EFFECT], ids=['pattern', 'effect'])
def test_the_posterior_of_a_job_is_the_prior_of_the_next_widened(parameters, campaign):
    """There and back through the coordinates of the file, shapes of effects included."""
    fit = linear_fit(np.random.default_rng(1), 60, parameters=parameters)
    fit = replace(fit, vector=np.clip(fit.vector, *parameters.bounds))
    prior = replace(parameters, known=posterior_of(fit, campaign)).prior
    between = [c.between_jobs for c in PATTERN]
    between += [EFFECT_BETWEEN_JOBS] * (len(parameters) - len(PATTERN))
    assert prior.centre == pytest.approx(fit.vector)
    assert prior.factor @ prior.factor.T == pytest.approx(
        scaled_covariance(fit) + np.diag(np.square(between)), rel=1e-6, abs=1e-12
    )


def test_effects_are_told_in_their_own_units(campaign):
    fit = linear_fit(np.random.default_rng(2), 60, parameters=WITH_EFFECT)
    vector = WITH_EFFECT.encode(WITH_EFFECT.start)
    told = posterior_of(replace(fit, vector=vector), campaign).mean
    assert told['corner_slowdown.gain'] == pytest.approx(0.5)
    assert np.exp(told['corner_slowdown.log_length_m']) == pytest.approx(0.2)
    assert np.exp(told['log_K1']) == pytest.approx(DepositionModel().planar.K1_cm3_per_s)


def test_what_nothing_is_known_of_keeps_its_weak_prior():
    both = replace(WITH_EFFECT, known=correlated(PARAMETERS)).prior
    alone = KNOWN.prior
    count = len(PATTERN)
    assert both.factor[:count, :count] == pytest.approx(alone.factor)
    assert both.centre[count:] == pytest.approx(WITH_EFFECT.weak_prior.centre[count:])
    assert both.factor[count:, count:] == pytest.approx(np.eye(len(WITH_EFFECT) - count))
    assert not both.factor[count:, :count].any()


def test_effects_that_are_not_varied_have_no_part_in_the_prior():
    known = correlated(WITH_EFFECT)
    whole, part = replace(WITH_EFFECT, known=known).prior, replace(PARAMETERS, known=known).prior
    count = len(PATTERN)
    covariance = whole.factor @ whole.factor.T
    assert part.factor @ part.factor.T == pytest.approx(covariance[:count, :count])


def test_knowing_the_pattern_narrows_a_fit_of_few_readings():
    jacobian = np.random.default_rng(3).normal(size=(5, len(PATTERN)))
    data = jacobian @ KNOWN.prior.centre
    weak, known = (fit_linear(jacobian, data, p) for p in (PARAMETERS, KNOWN))
    assert known.vector == pytest.approx(KNOWN.prior.centre)
    assert known.penalty == pytest.approx(0.0, abs=1e-12)
    covariance = scaled_covariance(known)
    assert (np.diag(covariance) < np.diag(scaled_covariance(weak))).all()
    precision = jacobian.T @ jacobian + KNOWN.prior.precision
    assert covariance == pytest.approx(np.linalg.inv(precision))


def test_no_reading_counts_twice(campaign):
    fit = linear_fit(np.random.default_rng(4), 60)
    posterior = posterior_of(fit, campaign)
    assert posterior.readings == fingerprints(campaign)
    known, remarks = usable(posterior, campaign)
    assert known is None
    assert 'panel' in remarks[0]
    (panel,) = campaign.experiments
    thicker = replace(panel.taken, thickness_um=panel.taken.thickness_um + 0.01)
    other = Campaign((replace(panel, taken=thicker),))
    assert usable(posterior, other) == (posterior, ())
    assert usable(None, campaign) == (None, ())
    later = replace(fit, parameters=replace(fit.parameters, known=posterior))
    assert posterior_of(later, other).readings == (*posterior.readings, *fingerprints(other))


def test_other_settings_of_the_process_are_told(campaign):
    def at(**settings) -> Campaign:
        (panel,) = campaign.experiments
        other = replace(panel.taken, thickness_um=panel.taken.thickness_um + 0.01)
        return Campaign((replace(panel, taken=other, settings=settings),))

    (panel,) = campaign.experiments
    calibrated = Campaign((replace(panel, settings={'voltage_kv': 60.0, 'flow': 1.0}),))
    posterior = posterior_of(linear_fit(np.random.default_rng(4), 60), calibrated)
    assert posterior.process == {'voltage_kv': 60.0, 'flow': 1.0}
    known, (remark,) = usable(posterior, at(voltage_kv=0.0, flow=1.01))
    assert known == posterior
    assert 'calibrated at voltage_kv 60, this job was painted at 0:' in remark
    assert usable(posterior, at(voltage_kv=61.0)) == (posterior, ())
    assert usable(posterior, at()) == (posterior, ())
