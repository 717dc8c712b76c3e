"""The error on parts left out is that of really refitting without them."""

from dataclasses import replace

import numpy as np
import pytest

import paint_deposition as pd
from inference.fitting.panels import gauged, reading
from paint_deposition.effects.library.edge_build import EdgeBuild
from paint_deposition.inference.diagnosis.verdict import Step
from paint_deposition.inference.fitting.cleaning import clean_and_fit
from paint_deposition.inference.readings.readings import root_mean_square

BASE = pd.DepositionModel()
# Heights of the passes on each panel [m], and how much more paint it got than the model says.
PASSES_M = ((0.3, 1.1, 0.7, 1.5), (1.6, 0.6, 1.1), (0.2, 1.0, 1.8))
LEVELS = (1.03, 0.97, 1.04)
MISSING = BASE.with_effect(EdgeBuild(gain=1.0, length_m=0.08))


def levelled(truth: pd.DepositionModel) -> pd.Campaign:
    """Panels, each with passes of its own and more or less paint than the others."""
    panels = gauged(truth, seed=4, orders=PASSES_M).experiments
    return pd.Campaign(tuple(
        reading(panel, level * panel.readings.thickness_um)
        for panel, level in zip(panels, LEVELS, strict=True)
    ))  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize('truth', [BASE, MISSING], ids=['clean', 'an effect missing'])
def test_the_error_on_a_part_left_out_is_that_of_a_model_that_never_saw_it(truth):
    """Also where the model misses much: then the fit without a part is far from that with it."""
    campaign = levelled(truth)
    study, fit = clean_and_fit(campaign, BASE, starts=6)
    owner = study.campaign.experiment_of
    found_um, anew_um = [], []
    for number, part in enumerate(campaign.experiments):
        out = owner == number
        left_um = (study.measured_um - study.predicted_without_um(fit, out))[out]
        others = pd.Campaign(tuple(one for one in campaign.experiments if one is not part))
        model = pd.refit(others, None, BASE).model
        other_um = pd.compare(pd.Campaign((part,)), model).points.residual_um
        assert root_mean_square(left_um) == pytest.approx(root_mean_square(other_um), rel=0.03)
        found_um.append(left_um)
        anew_um.append(other_um)
    step = Step.of(study, '', fit)
    assert np.array_equal(study.folds(), owner)
    found, anew = (root_mean_square(np.concatenate(each)) for each in (found_um, anew_um))
    assert step.holdout_rmse_um == pytest.approx(found)
    assert step.holdout_rmse_um == pytest.approx(anew, rel=0.02)
    # The level of a part is not known beforehand.
    assert step.holdout_rmse_um > step.rmse_um


@pytest.fixture(scope='module')
def study_and_fit():
    return clean_and_fit(levelled(MISSING), BASE)


def test_readings_left_out_have_no_part_in_what_is_predicted(study_and_fit):
    """However wrong they are: neither by themselves nor by the level of their part."""
    study, fit = study_and_fit
    out = study.campaign.experiment_of == 1
    first, part, last = study.campaign.experiments
    wrong = reading(part, part.readings.thickness_um + 100.0)
    other = replace(study, campaign=pd.Campaign((first, wrong, last)))
    assert (other.measured_um[out] > study.measured_um[out] + 99.0).all()
    before, after = (one.predicted_without_um(fit, out) for one in (study, other))
    assert after == pytest.approx(before, rel=1e-4, abs=1e-3)


def test_a_direction_that_is_fitted_too_counts_as_predicted(study_and_fit):
    """What is learned beside the model from the other parts is predicted on the last."""
    study, fit = study_and_fit
    out = study.campaign.experiment_of == 2
    predict = study.forward.predict_um
    edge_um = predict(fit.model.with_effect(MISSING.effects[0])) - predict(fit.model)
    free = (edge_um / study.sigma_um)[:, np.newaxis]
    without_it, with_it = (
        root_mean_square((study.measured_um - study.predicted_without_um(fit, out, each))[out])
        for each in (None, free)
    )
    assert with_it < 0.6 * without_it
