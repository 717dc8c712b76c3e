"""What a diagnosis says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, Literal

from paint_deposition.effects.base import Effect
from paint_deposition.effects.closed_forms import forms_of
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.learned_laws import LearnedLaw
from paint_deposition.film.spray_geometry import SprayGeometry
from paint_deposition.inference.comparison.comparison import Comparison, compare
from paint_deposition.inference.diagnosis.model_space import ALPHA
from paint_deposition.inference.fitting.estimates import DiscrepancyFigures, Estimate
from paint_deposition.inference.fitting.least_squares import Fit
from paint_deposition.inference.fitting.panel import Panel
from paint_deposition.inference.fitting.parameters import Posterior
from paint_deposition.inference.fitting.posterior import PatternShift, posterior_of
from paint_deposition.inference.fitting.random_effects import Amount, amounts
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.readings import beyond_noise_um, is_worse

if TYPE_CHECKING:  # what comes after a diagnosis and is kept with it
    from paint_deposition.inference.design.proposals import Place, Spray

Verdict = Literal['none_missing', 'effect_missing', 'undecided', 'unknown_effect', 'fit_broken']


def percent(probability: float) -> str:
    """A probability in print, never as 0 % or 100 %: no diagnosis is certain."""
    if probability > 0.99:
        return '> 99 %'
    return '< 1 %' if probability < 0.01 else f'{100 * probability:.0f} %'


@dataclass(frozen=True)
class EffectClass:
    """Effects that these readings cannot tell apart."""

    members: tuple[str, ...]  # ids, most probable first
    probability: float  # that one of them is missing
    best: str  # id of the most probable member
    parameters: dict[str, Estimate] = field(default_factory=dict)  # of the best member, by name
    # Before and after adding the best member, on points left out.
    holdout_rmse_um: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Unknown:
    """Where something shows that the library does not explain."""

    covariate: str  # the one that the residual depends on most
    p_value: float  # of that dependence
    curve: dict[str, list[float]]  # values of the covariate and mean residual there [um]
    where: str  # the place where it is strongest, in words
    part: str  # of which that is, '' where no place stands out
    parts: tuple[str, ...]  # names of those on which it shows
    since: str  # name of the first of them, if it shows on all that follow and on none before
    # Mean residual at that place [um], and over the film that the model has there.
    mean_residual_um: float
    share: float

    def __str__(self) -> str:
        against = f'most with {self.covariate}' if self.p_value < ALPHA else ''
        if not self.part:
            words = f'it shows {against}; {self.where}.' if against else f'{self.where}.'
            return words[0].upper() + words[1:]
        more, since = 'more' if self.mean_residual_um > 0.0 else 'less', ''
        on = f'on {", ".join(self.parts)}' if len(self.parts) > 1 else ''
        if self.since:
            since, on = f', since {self.since}', ''
        shows = ', '.join(filter(None, [on, against]))
        return (
            f'On {self.part}, {self.where.partition(", ")[0]}, there is '
            f'{abs(self.mean_residual_um):.1f} µm ({100.0 * abs(self.share):.0f} %) {more} than '
            f'the model says{since}{"; it shows " if shows else ""}{shows}.'
        )


@dataclass(frozen=True)
class Step:
    """One model of the history."""

    added: str  # effect id, '' for the model that the run started from
    fit: Fit  # of the model to the readings
    # On the fitted points [um], beside the estimated levels of the parts, see ``Study.residuals``;
    # and on points left out, the model being refitted without them. Their level is not known but
    # where no other part could tell it, see ``levels_untold``.
    rmse_um: float
    holdout_rmse_um: float
    # The latter if the effects are sought anew without them, too.
    nested_rmse_um: float

    @property
    def model(self) -> DepositionModel:
        """The fitted model."""
        return self.fit.model

    def beyond_noise_um(self, noise_um: float) -> float:
        """Error on what was left out, beyond gauge and texture [um]."""
        return beyond_noise_um(self.holdout_rmse_um, noise_um)

    @staticmethod
    def of(
        study: Study, added: str, fit: Fit, holdout_um: tuple[float, float] | None = None
    ) -> Step:
        """Compute the errors of a fit.

        Args:
            holdout_um: both errors on points left out, where they are known [um].
        """
        if holdout_um is None:
            without = partial(study.predicted_without_um, fit)
            holdout_um = 2 * (float(study.errors_left_out_um(without)),)
        return Step(added, fit, study.residuals(fit.predicted_um).rmse_um, *holdout_um)

    @property
    def needs_all(self) -> bool:
        """Whether parts left out leave too few readings to find what all of them show."""
        return abs(self.nested_rmse_um - self.holdout_rmse_um) > 0.15 * self.holdout_rmse_um


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
        not_testable: ids that these readings cannot see at any physical size.
        detectable: smallest amplitude of each testable effect that would have been seen.
        library: the effects that were looked for, by id.
        remarks: on what was known before, a sentence each.
        discrepancy: the discrepancy; None where the fit is broken.
        proposals: places to measure and sprays that would settle the diagnosis, best first; see
            ``next_experiment.with_proposals``.
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
    library: Mapping[str, type[Effect]] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    discrepancy: DiscrepancyFigures | None = None
    proposals: tuple[Sequence[Place], Sequence[Spray]] = ((), ())

    def __repr__(self) -> str:
        before, after = self.history[0].rmse_um, self.history[-1].rmse_um
        found = f' {", ".join(self.accepted)}' if self.accepted else ''
        return f'Diagnosis({self.verdict}{found}, RMSE {before:.2f} -> {after:.2f} µm)'

    def columns(self) -> dict[str, list[Any]]:
        """Of every class of effects: its members, whether it was added, how probable it is."""
        return {
            'best': [one.best for one in self.classes],
            'members': [', '.join(one.members) for one in self.classes],
            'accepted': [one.best in self.accepted for one in self.classes],
            'probability': [one.probability for one in self.classes],
            'parameters': [
                ', '.join(
                    f'{name} {value.value:.4g} ({value.low:.4g} to {value.high:.4g})'
                    for name, value in one.parameters.items()
                )
                for one in self.classes
            ],
        }

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks for the user, warnings first."""
        return (*self.warnings, *self.discrepancy_note, *self.study.notes)

    @property
    def discrepancy_note(self) -> tuple[str, ...]:
        """The discrepancy, in a sentence; nothing where the fit is broken."""
        return (str(self.discrepancy),) if self.discrepancy else ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """Why what was known before does not suit this job, a sentence each."""
        shift, doubt = self.pattern_shift, ''
        if self.verdict != 'fit_broken':
            _, doubt = self.study.level_doubt(self.history[-1].fit)
        moved = (shift.warning,) if shift and shift.is_alarming else ()
        return (*moved, *((doubt,) if doubt not in self.reason else ()), *self.remarks)

    @cached_property
    def pattern_shift(self) -> PatternShift | None:
        """How far the pattern moved from what was known before; None if nothing was."""
        return PatternShift.of(self.history[-1].fit)

    @cached_property
    def calibrate_first(self) -> bool:
        """Whether it is open what is missing, and no panel has shown the pattern alone.

        A known pattern cannot mimic an effect.
        """
        is_open = self.verdict in ('undecided', 'unknown_effect') or any(
            len(found.members) > 1 for found in self.classes if found.best in self.accepted
        )
        panels = map(Panel.of, self.study.campaign.experiments)
        return is_open and self.pattern_shift is None and not any(panels)

    @cached_property
    def random_effects(self) -> tuple[Amount, ...]:
        """Estimated levels of parts and zeros of gauge sessions."""
        return amounts(*self.history[-1].fit.amplitudes, self.study.random_effects)

    @property
    def left_out(self) -> str:
        """What is left out in turn for the error that was not fitted: parts or patches."""
        return 'parts' if self.study.leaves_out_parts else 'patches'

    @cached_property
    def worse(self) -> tuple[str, ...]:
        """Parts, rows and columns that the newest model predicts worse, a phrase each."""
        after = self.comparisons[-1].misfits
        return tuple(
            f'{name}{"" if kind == "experiment" else f", {label}"}: '
            f'{before.rmse_um:.2f} -> {after[name, kind, label].rmse_um:.2f} µm'
            for (name, kind, label), before in self.comparisons[0].misfits.items()
            if kind in ('experiment', 'group') and is_worse(before, after[name, kind, label])
        )

    @property
    def posterior(self) -> Posterior:
        """What is known of the model with what was accepted: a prior for the next job."""
        return self.posterior_at(self.history[-1])

    def posterior_at(self, step: Step) -> Posterior:
        """The same of one model of the history."""
        return posterior_of(step.fit, self.study.campaign, self.discrepancy)

    @property
    def model(self) -> DepositionModel:
        """The model with what was accepted."""
        return self.history[-1].model

    @cached_property
    def comparisons(self) -> tuple[Comparison, ...]:
        """Each model of the history beside the readings."""
        return tuple(compare(self.study, step.model) for step in self.history)

    @property
    def geometry(self) -> dict[str, SprayGeometry]:
        """How the gun ran over each part, by experiment."""
        return self.comparisons[-1].geometry

    def to_dict(self) -> dict[str, Any]:
        """The content of ``diagnosis.json``."""
        before, after = self.history[0], self.history[-1]
        predicted = before.fit.predicted_um, after.fit.predicted_um
        noise_um = self.study.noise_floor_um
        places, sprays = self.proposals
        classes = []
        for found in self.classes:
            ends = {
                name: {'value': one.value, 'low': one.low, 'high': one.high}
                for name, one in found.parameters.items()
            }
            classes.append(asdict(found) | {'parameters': ends})
            law = self.model.effect(found.best)
            if isinstance(law, LearnedLaw):
                classes[-1]['forms'] = [form.to_dict() for form in forms_of(law)]
        return {
            'verdict': self.verdict,
            'reason': self.reason,
            'p_value': self.p_value,
            'accepted': list(self.accepted),
            'classes': classes,
            'rmse_um': {
                'before': before.rmse_um,
                'after': after.rmse_um,
                'holdout_before': before.holdout_rmse_um,
                'holdout_after': after.nested_rmse_um,
                'holdout_after_refitted': after.holdout_rmse_um,
                'beyond_noise_before': before.beyond_noise_um(noise_um),
                'beyond_noise_after': after.beyond_noise_um(noise_um),
                'noise_floor': noise_um,
                'left_out': 'experiments' if self.left_out == 'parts' else 'points',
            },
            'experiments': [
                {'name': one.name, 'rmse_before_um': old.rmse_um, 'rmse_after_um': new.rmse_um}
                for one, old, new in zip(
                    self.study.campaign.experiments,
                    *map(self.study.residuals_by_experiment, predicted),
                    strict=True,
                )
            ],
            'worse': list(self.worse),
            'unknown': None if self.unknown is None else asdict(self.unknown),
            'not_testable': list(self.not_testable),
            'detectable': self.detectable,
            'regions': [region.to_dict() for region in self.comparisons[0].regions],
            'zones': [zone.to_dict() for zone in self.comparisons[-1].zones],
            'next': {
                'calibrate': self.calibrate_first,
                'measure': [place.to_dict() for place in places],
                'spray': [spray.to_dict() for spray in sprays],
            },
            'pattern_shift': self.pattern_shift and self.pattern_shift.to_dict(),
            'random_effects': [asdict(amount) for amount in self.random_effects],
            'noise': self.study.noise_figures,
            'discrepancy': self.discrepancy and self.discrepancy.to_dict(),
            'footprint': self.discrepancy and self.discrepancy.footprint,
            'left_out': [slip.to_dict() for slip in self.study.outliers],
            'geometry': {name: found.to_dict() for name, found in self.geometry.items()},
            'notes': list(self.notes),
        }
