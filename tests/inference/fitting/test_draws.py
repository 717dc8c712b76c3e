"""Models drawn from a posterior: the normal distribution within what is physical."""

import numpy as np
import pytest
from scipy.stats import truncnorm

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.library.corner_slowdown import CornerSlowdown
from paint_deposition.errors import ModelError
from paint_deposition.inference.fitting.posterior import draw_models
from paint_deposition.inference.posterior import Posterior
from paint_deposition.model.eq1_pattern import PATTERN

COUNT = 4000
GAIN = 'corner_slowdown.gain'
MODEL = DepositionModel(effects=(CornerSlowdown(gain=0.1, length_m=0.1),))


def known(means: dict[str, float], deviations: dict[str, float]) -> Posterior:
    """Of a well known pattern but for these coordinates, all independent."""
    centres = {c.name: c.centre for c in PATTERN} | {GAIN: 0.1} | means
    rows = np.diag([deviations.get(name, 1e-4) ** 2 for name in centres])
    return Posterior(mean=centres, covariance=dict(zip(centres, rows.tolist(), strict=True)))


def test_draws_near_a_bound_follow_the_truncated_normal():
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


def test_the_asymmetry_of_a_draw_is_at_most_one():
    wide = known({'K3_cos_phi': 0.7}, {'K3_cos_phi': 0.3, 'K3_sin_phi': 0.6})
    asymmetry = np.array([model.planar.K3 for model in draw_models(MODEL, wide, COUNT, seed=2)])
    assert len(np.unique(asymmetry)) == COUNT
    assert asymmetry.max() <= 1.0


def test_a_posterior_that_is_nowhere_physical_is_refused():
    with pytest.raises(ModelError, match='posterior: of 1000 draws 0 are within the bounds'):
        draw_models(MODEL, known({'K2': -0.5}, {'K2': 0.01}), 1, seed=3)
