"""One run of the inference: a model fitted to a campaign, and what is added to it.

What is added is the caller's choice: ``diagnose`` adds what is most probable, ``refit`` what the
user asks for.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.special import fdtr

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.learned_laws import LearnedLaw
from paint_deposition.inference.diagnosis.explanations import (
    Explanation,
    candidates_beside,
    nonparametric_laws_of,
    of_places,
)
from paint_deposition.inference.diagnosis.testability import Testability
from paint_deposition.inference.diagnosis.verdict import (
    Diagnosis,
    EffectClass,
    Step,
    Unknown,
    Verdict,
)
from paint_deposition.inference.fitting.cleaning import clean_and_fit
from paint_deposition.inference.fitting.estimates import DiscrepancyFigures, Estimate, estimates
from paint_deposition.inference.fitting.least_squares import Fit
from paint_deposition.inference.fitting.parameters import FreeParameters, Posterior
from paint_deposition.inference.fitting.posterior import prior_for
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.campaign import Campaign

# Starts of the first fit.
STARTS = 10


@dataclass(frozen=True)
class DiagnosisState:
    """A fitted model, what has been added to it, and what may still be added.

    What is found is passed on in a new state.

    Attributes:
        study: the readings.
        start: the model that was started from.
        known: what is known of its parameters: the prior. None if nothing is.
        remarks: why something that is known is not used, a sentence each.
        candidates: effects that may be missing, at neutral amplitude and in a few shapes, by id.
        seed: of starts and simulated deviations.
        fit: of the newest model.
        history: every model so far, the one started from first.
        accepted: the effects and learned laws added so far, with what is confounded with each.
        testable: what the readings can show; None while it is not known.
        amplitude_sizes: of effects that were found, times their typical ones, by id.
        figures, discrepancy: of the discrepancy, and its covariance (P, P) over the noise, by
            which intervals are wider; None while they are not known.
    """

    study: Study
    start: DepositionModel
    known: Posterior | None
    remarks: tuple[str, ...]
    candidates: Mapping[str, list[Effect]]
    seed: int
    fit: Fit
    history: tuple[Step, ...]
    accepted: tuple[EffectClass, ...] = ()
    testable: Testability | None = None
    amplitude_sizes: Mapping[str, float] = field(default_factory=dict)
    figures: DiscrepancyFigures | None = None
    discrepancy: np.ndarray | None = None

    @staticmethod
    def begin(
        campaign: Campaign,
        start: DepositionModel,
        library: Mapping[str, type[Effect]],
        seed: int,
        known: Posterior | None = None,
        sound: Collection[str] = (),
    ) -> 'DiagnosisState':
        """Fit a model to a campaign; effects of a library may be added to it.

        Readings at points with the labels ``sound`` are no outliers.
        """
        candidates = candidates_beside(start, library)
        prior, remarks = prior_for(known, campaign)
        effects = (*start.effects, *(shapes[0] for shapes in candidates.values()))
        study, fit = clean_and_fit(campaign, start, effects, STARTS, seed, prior, sound)
        first = (Step.of(study, '', fit),)
        return DiagnosisState(study, start, prior, remarks, candidates, seed, fit, first)

    def _free(self, start: DepositionModel) -> FreeParameters:
        """All parameters of a model, with what is known of them."""
        return FreeParameters.of(
            start, *start.effects, known=self.known, amplitude_sizes=self.amplitude_sizes
        )

    @cached_property
    def nonparametric_laws(self) -> list[Explanation]:
        """Laws of any form, for what is outside the library: over a condition, or on a part."""
        model = self.history[0].model
        found = [nonparametric_laws_of(self.study, model), of_places(self.study, model, each=True)]
        return [replace(e, share=0.5 * e.share) for laws in found for e in laws]

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the noise estimate."""
        return self.study.noise.degrees_of_freedom

    def candidates_in(self, fit: Fit) -> list[Effect]:
        """The candidates that the model of a fit has."""
        return [e for e in fit.model.effects if e.id in self.candidates]

    def fitted_with(
        self,
        effects: Sequence[Effect],
        model: DepositionModel,
        directions: np.ndarray | None = None,
        discrepancy: np.ndarray | None = None,
        others: Sequence[DepositionModel] = (),
        starts: int = 1,
        amplitude_sizes: Mapping[str, float] | None = None,
    ) -> Fit:
        """The start model refitted with these effects instead of what was added.

        Args:
            effects: with their first values.
            model: to start from.
            directions: (P, n) over the noise that are left free beside them.
            discrepancy: (P, P) covariance of the discrepancy, if that is allowed for.
            others: models whose patterns are starts, too.
            starts: how many, as in the first fit.
            amplitude_sizes: of the effects, times their typical ones; default: the state's.
        """
        kept = tuple(e for e in model.effects if e.id not in self.candidates)
        start = model.model_copy(update={'effects': (*kept, *effects)})
        nuisance = self.study.nuisance
        if directions is not None:
            nuisance = np.hstack([nuisance, directions])
        free = self._free(start)
        if amplitude_sizes is not None:
            free = replace(free, amplitude_sizes=amplitude_sizes)
        return self.study.fit(free, starts, self.seed, nuisance, discrepancy, others)

    def learned(self, chosen: Sequence[tuple[Explanation, float]]) -> Fit:
        """The newest model with the laws that these explanations, at these sizes, stand for."""
        fit = self.fit
        laws: tuple[LearnedLaw, ...] = ()
        # The laws and the model's parameters are fitted to each other, until they suit.
        for _ in range(8):
            randoms = [
                explanation.random.around(self.study, fit.model)
                for explanation, _ in chosen
                if explanation.random
            ]
            parts = [
                size * random.change_um / self.study.sigma_um[:, np.newaxis]
                for random, (_, size) in zip(randoms, chosen, strict=True)
            ]
            columns, before = np.hstack(parts), fit.objective
            fit = self.fitted_with(self.candidates_in(fit), fit.model, columns)
            covariance = np.eye(len(self.study)) + fit.nuisance @ fit.nuisance.T
            amounts = columns.T @ np.linalg.solve(covariance, fit.residual)
            known = fit.amplitudes[1][-len(amounts) :, -len(amounts) :]
            stops = np.cumsum([part.shape[1] for part in parts])
            laws = tuple(
                random.learned(size * amounts[rows], size**2 * known[rows, rows])
                for random, (_, size), part, stop in zip(
                    randoms, chosen, parts, stops, strict=True
                )
                for rows in [slice(stop - part.shape[1], stop)]
            )
            if abs(before - fit.objective) < 0.5:
                break
        start = fit.model.model_copy(update={'effects': (*fit.model.effects, *laws)})
        return self.study.fit(self._free(start), nuisance=self.study.nuisance)

    def with_step(
        self, added: str, fit: Fit, holdout_um: tuple[float, float] | None = None
    ) -> 'DiagnosisState':
        """The state with a newer model; see ``Step.of``."""
        step = Step.of(self.study, added, fit, holdout_um)
        return replace(self, fit=fit, history=(*self.history, step))

    def accepting(
        self, members: tuple[str, ...], probability: float, before: Step
    ) -> 'DiagnosisState':
        """The state with a class accepted, see ``described``."""
        found = self.described(members, probability, before)
        return replace(self, accepted=(*self.accepted, found))

    def described(
        self,
        members: tuple[str, ...],
        probability: float,
        before: Step,
        trial: Fit | None = None,
    ) -> EffectClass:
        """A class with its intervals and the errors before and after adding its best effect.

        Args:
            members: ids, the best first.
            probability: that one of them is missing.
            before: the model without it.
            trial: a fit with the best one; default: the newest model.
        """
        after = self.history[-1] if trial is None else Step.of(self.study, members[0], trial)
        return EffectClass(
            members,
            min(probability, 1.0),
            members[0],
            intervals(replace(after.fit, discrepancy=self.discrepancy), members[0]),
            {'before': before.holdout_rmse_um, 'after': after.holdout_rmse_um},
        )

    def diagnosis(
        self,
        p_value: float,
        verdict: Verdict,
        reason: str,
        others: tuple[EffectClass, ...] = (),
        unknown: Unknown | None = None,
    ) -> Diagnosis:
        """Put the results together."""
        not_testable, detectable = self.testable or ((), {})
        final = replace(self.fit, discrepancy=self.discrepancy)
        accepted = tuple(
            replace(c, parameters=intervals(final, c.best) or c.parameters) for c in self.accepted
        )
        listed = {member for c in (*self.accepted, *others) for member in c.members}
        return Diagnosis(
            self.study,
            verdict,
            reason,
            p_value,
            tuple(c.best for c in self.accepted),
            (*accepted, *others),
            tuple(
                replace(step, fit=replace(step.fit, discrepancy=self.discrepancy))
                for step in self.history
            ),
            unknown,
            tuple(name for name in not_testable if name not in listed),
            detectable,
            remarks=self.remarks,
            discrepancy=self.figures,
        )


def intervals(fit: Fit, effect_id: str) -> dict[str, Estimate]:
    """An effect's parameters by name, with 95 % intervals within what is physical."""
    every = {estimate.name: estimate for estimate in estimates(fit)}
    of = f'{effect_id}.'
    return {name.removeprefix(of): one for name, one in every.items() if name.startswith(of)}


def trouble_with(study: Study, fit: Fit) -> str:
    """Why the fit cannot be right, '' if it can."""
    if wrong := [sentence for sentence, stops in study.mistakes if stops]:
        return '; '.join(wrong)
    mean = float(np.mean(study.measured_um))
    # So many standard deviations above the prediction the gauge found paint; below this share of
    # the mean film it may be the tail of a footprint.
    painted = (fit.residual > 3.0) & (study.measured_um > 0.2 * mean)
    # A point that gets less than this share of the mean film was hardly reached by the path.
    bare = float(np.mean(painted & (fit.predicted_um < 0.02 * mean)))
    freedom = len(study) - len(fit.vector)
    if freedom < 5:
        return (
            f'{len(study)} points cannot determine {len(fit.vector)} parameters; '
            'measure at 30 points or more'
        )
    if bare > 0.1:
        return (
            f'the recorded path leaves {100 * bare:.0f} % of the points bare, where '
            'the gauge found paint; check the trajectory, its trigger and the mesh frame'
        )
    if not fit.converged:
        return 'the fit did not converge; give a start model nearer to the bell in use'
    if study.noise.source != 'assumed':
        # Of the gauge alone: that a film has little texture is no fault.
        over_gauge = fit.residual * study.sigma_um / study.gauge_um
        reduced = float(over_gauge @ over_gauge) / freedom
        chance = fdtr(freedom, min(study.noise.degrees_of_freedom, 1e6), reduced)
        # Below this probability of residuals so small the noise is overstated, or the readings
        # were made up.
        if chance < 1e-4:
            return (
                f'the readings scatter about the model {np.sqrt(reduced):.2f} times as much as '
                f'their noise says ({study.noise.source}); give their true sigma_um or repeats'
            )
    return ''
