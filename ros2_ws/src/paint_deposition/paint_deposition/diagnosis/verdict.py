"""What a diagnosis says."""

from dataclasses import dataclass, field
from typing import Literal

from paint_deposition.diagnosis.cross_validation import hold_out
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.fitting.least_squares import Fit
from paint_deposition.fitting.study import Study
from paint_deposition.readings.residuals import root_mean_square

Verdict = Literal['none_missing', 'effect_missing', 'undecided', 'unknown_effect', 'fit_broken']


@dataclass(frozen=True)
class Interval:
    """A parameter's value with its 95 % interval, in its own unit."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class EffectClass:
    """Effects that these readings cannot tell apart.

    Attributes:
        members: ids, most probable first.
        probability: that one of them is missing.
        best: id of the most probable member.
        parameters: of the best member, by name.
        holdout_rmse_um: before and after adding the best member, on points left out.
    """

    members: tuple[str, ...]
    probability: float
    best: str
    parameters: dict[str, Interval] = field(default_factory=dict)
    holdout_rmse_um: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Unknown:
    """Where something shows that the library does not explain.

    Attributes:
        kind: 'footprint' if the pattern itself deviates from eq. (1), else 'effect'.
        covariate: the one that the residual depends on most.
        p_value: of that dependence.
        curve: values of the covariate and mean residual there [um].
        where: in words.
    """

    kind: str
    covariate: str
    p_value: float
    curve: dict[str, list[float]]
    where: str


@dataclass(frozen=True)
class Step:
    """One model of the history.

    Attributes:
        added: effect id, '' for the model that the run started from.
        fit: of the model to the readings.
        rmse_um, holdout_rmse_um: on the fitted points and on points left out [um].
    """

    added: str
    fit: Fit
    rmse_um: float
    holdout_rmse_um: float

    @property
    def model(self) -> DepositionModel:
        """The fitted model."""
        return self.fit.model

    @staticmethod
    def of(study: Study, added: str, fit: Fit) -> 'Step':
        """Compute the errors of a fit, those on points left out by patches."""
        left_out_um = hold_out(fit, study.patches()).deviation * study.sigma_um
        fitted = study.residuals(fit.predicted_um)
        return Step(added, fit, fitted.rmse_um, root_mean_square(left_out_um))


@dataclass(frozen=True)
class Diagnosis:
    """The verdict and what it rests on.

    Attributes:
        study: the readings.
        verdict: the headline.
        reason: one sentence for the user.
        p_value: that as much evidence appears when nothing is missing; nan if not tested.
        accepted: ids of the effects added to the model, in order.
        classes: accepted ones in that order, then others by probability.
        history: the models, base first.
        unknown: where the unexplained shows, or None.
        not_testable: ids that these readings cannot see at typical size.
        detectable: smallest amplitude of each testable effect that would have been seen.
    """

    study: Study
    verdict: Verdict
    reason: str
    p_value: float
    accepted: tuple[str, ...]
    classes: tuple[EffectClass, ...]
    history: tuple[Step, ...]
    unknown: Unknown | None = None
    not_testable: tuple[str, ...] = ()
    detectable: dict[str, dict[str, float]] = field(default_factory=dict)

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks for the user."""
        return self.study.notes

    @property
    def noise_floor_um(self) -> float:
        """Standard deviation of the gauge at the points [um]."""
        return self.study.noise_floor_um

    @property
    def model(self) -> DepositionModel:
        """The model with what was accepted."""
        return self.history[-1].model
