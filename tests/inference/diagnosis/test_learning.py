"""Leaving out points by moving the fit linearly is refitting, where the model is linear."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from inference.diagnosis.linear import (
    KNOWN,
    PARAMETERS,
    fit_linear,
    linear_fit,
    no_discrepancy,
    null_of,
    smooth_curves,
)
from paint_deposition.inference.diagnosis.discrepancy import DiscrepancyHyperparameters
from paint_deposition.inference.diagnosis.explanations import UNKNOWN, Explanation
from paint_deposition.inference.diagnosis.gaussian import NullModel, hold_out, left_out
from paint_deposition.inference.diagnosis.learning import MOST_LAWS, LeftOut, NullModels
from paint_deposition.inference.diagnosis.model_space import PRIOR_EFFECT, WeightedNull, log_odds
from paint_deposition.inference.diagnosis.search import EffectSet, SearchStage
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


# Choosing effects and laws without the points left out.

POINTS, SIGMA_UM, KNOTS = 80, 0.7, 8
FOLDS = np.arange(POINTS) // 8
PLACE = np.linspace(0.0, KNOTS - 1.0, POINTS)
FORM = np.where(np.arange(POINTS) % 4 == 0, 2.0, 0.2)
OTHER = np.where(np.arange(POINTS) % 5 == 0, 2.0, -0.3)
WAVE = 3.0 * np.sin(np.linspace(0.0, 7.0, POINTS))
NOTHING_LEFT = no_discrepancy(POINTS)


@dataclass(frozen=True)
class Points:
    """Readings in folds."""

    sigma_um: np.ndarray

    def folds(self) -> np.ndarray:
        return FOLDS


@dataclass(frozen=True)
class LinearRun:
    """A run whose models are exactly linear: a fit is the null model that it stands for."""

    study: Points
    freedom: float = np.inf
    nonparametric_laws: tuple[Explanation, ...] = ()

    def plain(self, fit: NullModel) -> NullModel:
        return fit


class LinearTrial(EffectSet):
    """A set of effects on such a state, beside which nature leaves nothing over."""

    @property
    def discrepancy(self):
        return self.usual

    @property
    def log_prior(self):
        return log_odds(PRIOR_EFFECT) * len(self.names)

    @property
    def weighed(self):
        return [WeightedNull.of(self.fit, self.usual, size, np.inf) for size in self.sizes]

    def nulls(self, fit):
        sizes = self.best.sizes
        beside = fit.with_discrepancy(self.usual.covariance(sizes))
        return NullModels(fit.with_discrepancy(self.usual.of_parts(sizes)), beside, beside, beside)


def trial(change: np.ndarray, *forms: np.ndarray, seed=0, sigma_um=None) -> LinearTrial:
    """On readings of noise that a change (P,) moved, with an effect of each form (P,)."""
    base = null_of(linear_fit(np.random.default_rng(seed), POINTS))
    effects = [2.0 * form[:, np.newaxis] for form in forms]
    null = NullModel.of(np.hstack([base.columns, *effects]), base.raw + change)
    study = Points(np.full(POINTS, SIGMA_UM) if sigma_um is None else sigma_um)
    names = frozenset(f'effect {k}' for k in range(len(forms)))
    return LinearTrial(
        LinearRun(study),
        names,
        null,
        NOTHING_LEFT,
        [DiscrepancyHyperparameters(0.0, 0.0, 0, 0, 0.0)],
    )


def stages_of(change: np.ndarray, **options) -> list[SearchStage]:
    """The search from nothing on to the effect and to another one beside it."""
    nothing, edge, both = (trial(change, *forms, **options)
                           for forms in ((), (FORM,), (FORM, OTHER)))  # fmt: skip
    found = [SearchStage(nothing, [edge]), SearchStage(edge, [both]), SearchStage(both, [])]
    last = next(k for k, stage in enumerate(found) if stage.chosen() is stage.here)
    return found[: last + 1]


def learnable(random: RandomLaw) -> Explanation:
    columns = random.change_um
    return Explanation(UNKNOWN, columns, np.zeros(columns.shape[1]), 1.0, random=random)


CURVES = [learnable(smooth_curves(PLACE, KNOTS, 0.5))]


def nested(stages, options=CURVES, without=()) -> np.ndarray:
    """By the number of laws learned, in standard deviations of the noise."""
    return LeftOut(stages, options).errors_um(frozenset(without)) / SIGMA_UM


@pytest.mark.parametrize(('change', 'found'), [(0.0, 0), (2.0, 1)])
def test_errors_are_those_of_the_set_that_the_other_points_call_for(change, found):
    stages = stages_of(change * FORM)
    assert len(stages) == found + 1
    expected = root_mean_square(hold_out(stages[found].here.fit, FOLDS))
    assert nested(stages)[0] == pytest.approx(expected, rel=1e-12)


def test_a_fold_that_calls_for_another_set_does_not_go_on():
    """The effect shows in one fold alone: without its points nobody would look for more."""
    here = FOLDS == 3
    stages = stages_of(6.0 * FORM * here)
    nothing, edge, *_ = [stage.here for stage in stages]
    deviation = hold_out(edge.fit, FOLDS)
    deviation[here] = left_out(nothing.fit, [], here)
    assert nested(stages)[0] == pytest.approx(root_mean_square(deviation), rel=1e-12)
    assert stages[0].chosen(~here) is nothing
    assert stages[0].chosen() is edge


def test_what_acts_lowers_the_nested_error_to_the_noise():
    """The effect by its law; the wave, which no law has, by one learned curve."""
    assert nested(stages_of(2.0 * FORM))[0] == pytest.approx(1.0, abs=0.25)
    without, *with_laws = nested(stages_of(WAVE))
    assert without > 1.7
    assert with_laws == pytest.approx([1.0] * MOST_LAWS, abs=0.3)
    without, *with_laws = nested(stages_of(WAVE + 2.0 * FORM))
    assert max(with_laws) < 0.8 * without
    # A covariate that is left out is not learned.
    kept_out = nested(stages_of(WAVE), without=(CURVES[0].learns,))
    assert kept_out == pytest.approx([kept_out[0]] * (1 + MOST_LAWS))


def test_a_law_must_say_more_than_any_footprint_could():
    columns = (3.0 * CURVES[0].columns,)
    wave = replace(NOTHING_LEFT, footprint=replace(NOTHING_LEFT.footprint, columns=columns))
    stages = [replace(one, here=replace(one.here, usual=wave)) for one in stages_of(WAVE)]
    assert nested(stages[-1:]) == pytest.approx([nested(stages_of(WAVE))[0]] * (1 + MOST_LAWS))


def test_a_point_left_out_has_no_part_in_its_own_prediction():
    """However wrong a fold is, what is predicted there stays as it is.

    Then the error there is that of before plus what was added, and its square is a parabola.
    """
    out = FOLDS == 3
    nothing, edge = (), (FORM,)

    def square(added: float) -> np.ndarray:
        here, tried = (
            trial(WAVE + 2.0 * FORM + added * out, *forms, sigma_um=out.astype(float))
            for forms in (nothing, edge)
        )
        return (
            POINTS
            * LeftOut([SearchStage(here, [tried]), SearchStage(tried, [])], CURVES).errors_um()
            ** 2
        )

    curvature = square(100.0) + square(-100.0) - 2.0 * square(0.0)
    assert curvature == pytest.approx(2.0 * out.sum() * 100.0**2, rel=1e-9)
    assert square(0.0)[1] != pytest.approx(square(0.0)[0], rel=1e-3)
