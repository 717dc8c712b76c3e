"""Leaving out points by moving the fit linearly is refitting, where the model is linear."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest

from inference.diagnosis.linear import (
    KNOWN,
    PARAMETERS,
    bounds,
    fit_linear,
    linear_fit,
    null_of,
    smooth_curves,
)
from paint_deposition.effects.library.edge_build import EdgeBuild
from paint_deposition.inference.diagnosis import learning
from paint_deposition.inference.diagnosis.cross_validation import (
    Stage,
    hold_out,
    left_out,
    nested_rmse_um,
)
from paint_deposition.inference.diagnosis.evidence import NullModel
from paint_deposition.inference.diagnosis.explanations import UNKNOWN, Explanation
from paint_deposition.inference.diagnosis.learning import MOST_LAWS
from paint_deposition.inference.diagnosis.model_space import ModelSpace
from paint_deposition.inference.diagnosis.sensitivities import Sensitivity
from paint_deposition.inference.diagnosis.smooth_laws import RandomLaw
from paint_deposition.inference.readings.residuals import root_mean_square

READINGS = 24
BLOCKS = np.arange(READINGS) % 5


@pytest.fixture(params=[PARAMETERS, KNOWN], ids=['weak', 'known'])
def fit(request):
    return linear_fit(np.random.default_rng(8), READINGS, parameters=request.param)


def test_the_linear_update_is_a_refit(fit):
    data = fit.predicted_um + fit.residual
    expected = np.empty(READINGS)
    for block in range(5):
        out = block == BLOCKS
        kept = fit_linear(fit.jacobian[~out], data[~out], fit.parameters)
        expected[out] = data[out] - fit.jacobian[out] @ kept.vector
    assert hold_out(null_of(fit), BLOCKS) == pytest.approx(expected)


def test_everything_left_out_is_predicted_by_the_priors(fit):
    prior = fit.parameters.prior
    data = fit.predicted_um + fit.residual
    deviation = hold_out(null_of(fit), np.zeros(READINGS))
    assert deviation == pytest.approx(data - fit.jacobian @ prior.centre)


def test_readings_left_out_are_predicted_worse_than_fitted_ones():
    random = np.random.default_rng(9)
    worse = 0
    for _ in range(20):
        fit = linear_fit(random, READINGS)
        worse += np.sum(hold_out(null_of(fit), BLOCKS) ** 2) > fit.chi_square
    assert worse == 20


# Choosing causes and laws without the points left out.

POINTS, SIGMA_UM, KNOTS = 80, 0.7, 8
FOLDS = np.arange(POINTS) // 8
PLACE = np.linspace(0.0, KNOTS - 1.0, POINTS)
FORM = np.where(np.arange(POINTS) % 4 == 0, 2.0, 0.2)
WAVE = 3.0 * np.sin(np.linspace(0.0, 7.0, POINTS))


@dataclass(frozen=True)
class Points:
    """What the nested search reads of a study."""

    sigma_um: np.ndarray

    def folds(self) -> np.ndarray:
        return FOLDS


def learnable(random: RandomLaw) -> Explanation:
    columns = random.change_um
    return Explanation(UNKNOWN, columns, np.zeros(columns.shape[1]), 1.0, random=random)


def space_of(change: np.ndarray, seed: int = 0, more: Sequence[Explanation] = ()) -> ModelSpace:
    """Edge build and curves over the place, on readings of noise that a change (P,) moved."""
    base = null_of(linear_fit(np.random.default_rng(seed), POINTS))
    null = NullModel.of(base.columns, base.raw + change)
    law = Sensitivity(EdgeBuild(), ('peak',), FORM[:, np.newaxis], *bounds([1]))
    edge = Explanation(EdgeBuild.id, law.columns, law.sides, 1.0, law)
    curves = learnable(smooth_curves(PLACE, KNOTS, 0.5))
    return ModelSpace(null, [edge, curves, *more], np.inf)


def nested(space: ModelSpace) -> np.ndarray:
    """By the number of laws learned, in standard deviations of the noise."""
    study = Points(np.full(POINTS, SIGMA_UM))
    return nested_rmse_um([Stage(space, space.null)], study) / SIGMA_UM


def test_on_noise_the_nested_errors_are_larger_than_the_fitted_one():
    for seed in range(5):
        fitted = linear_fit(np.random.default_rng(seed), POINTS).residual
        assert nested(space_of(np.zeros(POINTS), seed)).min() > root_mean_square(fitted)


def test_what_acts_lowers_the_nested_error_to_the_noise():
    """The effect by its law; the wave, which no law has, by one learned curve."""
    assert nested(space_of(2.0 * FORM))[0] == pytest.approx(1.0, abs=0.25)
    without, *with_laws = nested(space_of(WAVE))
    assert without > 1.7
    assert with_laws == pytest.approx([1.0] * MOST_LAWS, abs=0.3)
    without, *with_laws = nested(space_of(WAVE + 2.0 * FORM))
    assert max(with_laws) < 0.8 * without


def test_laws_chosen_on_all_points_flatter_and_nested_ones_do_not(monkeypatch):
    """On noise alone, of thirty laws that explain nothing, the best one must be learned."""
    monkeypatch.setattr(learning, 'WORTH_LEARNING', -np.inf)
    folds = [fold == FOLDS for fold in np.unique(FOLDS)]
    without, chosen_on_all, chosen_inside = [], [], []
    for seed in range(24):
        random = np.random.default_rng([7, seed])
        none = [learnable(smooth_curves(random.permutation(PLACE), KNOTS, 0.5)) for _ in range(30)]
        space = space_of(np.zeros(POINTS), seed, none)
        ((k, size),) = learning.choose_laws(space.null, space.explanations, np.inf)
        columns = [size * space.explanations[k].columns]
        errors = np.concatenate([left_out(space.null, columns, out) for out in folds])
        chosen_on_all.append(root_mean_square(errors))
        before, after, *_ = nested(space)
        without.append(before)
        chosen_inside.append(after)
    gain, nested_gain = np.subtract(without, chosen_on_all), np.subtract(without, chosen_inside)
    assert gain.mean() > 3.0 * gain.std() / np.sqrt(len(gain))
    assert nested_gain.mean() < 0.0


@pytest.mark.parametrize('goes_on', [True, False])
def test_the_search_goes_on_where_the_other_points_call_for_the_same(goes_on):
    """Of two stages, each fold reaches the second if it accepts what was accepted at the first."""
    first, second = space_of(2.0 * FORM), space_of(np.zeros(POINTS))
    accepted = frozenset([EdgeBuild.id] if goes_on else [])
    both = [Stage(first, first.null, accepted), Stage(second, second.null)]
    errors = nested_rmse_um(both, Points(np.ones(POINTS)))
    assert errors == pytest.approx(nested(second if goes_on else first), rel=1e-12)
    assert nested(first) != pytest.approx(nested(second), rel=1e-3)


def test_a_point_left_out_has_no_part_in_its_own_prediction():
    """However wrong a fold is, what is predicted there stays as it is.

    Then the error there is that of before plus what was added, and its square is a parabola.
    """
    out = FOLDS == 3
    only_there = Points(out.astype(float))

    def square(added: float) -> np.ndarray:
        space = space_of(WAVE + 2.0 * FORM + added * out)
        return POINTS * nested_rmse_um([Stage(space, space.null)], only_there) ** 2

    curvature = square(100.0) + square(-100.0) - 2.0 * square(0.0)
    assert curvature == pytest.approx(2.0 * out.sum() * 100.0**2, rel=1e-9)
    assert square(0.0)[1] != pytest.approx(square(0.0)[0], rel=1e-3)


def test_the_level_of_a_part_helps_to_predict_the_rest_of_it():
    level, out = np.ones((POINTS, 1)), FOLDS == 3
    raw = np.random.default_rng(1).normal(size=POINTS) + 5.0
    assert abs(left_out(NullModel.of(10.0 * level, raw), [], out).mean()) < 1.0
    assert left_out(NullModel.of(0.0 * level, raw), [], out) == pytest.approx(raw[out])
