"""One run of the inference: a model is fitted to a campaign and effects are added to it.

What is added is the caller's choice: ``diagnose`` adds what is most probable, ``refit`` what the
user asks for.
"""

from collections.abc import Callable, Mapping

import numpy as np
from scipy.stats import f as f_ratio

from paint_deposition.diagnosis.classes import ConfoundedClass
from paint_deposition.diagnosis.linearisation import Linearisation, linearise
from paint_deposition.diagnosis.sensitivities import Sensitivity, neutral_shapes
from paint_deposition.diagnosis.verdict import (
    Diagnosis,
    EffectClass,
    Interval,
    Step,
    Unknown,
    Verdict,
)
from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.fitting.estimates import estimates
from paint_deposition.fitting.least_squares import Fit
from paint_deposition.fitting.parameters import FreeParameters
from paint_deposition.fitting.study import Study
from paint_deposition.readings.campaign import Campaign

# Significance level of the test that something is missing, and the posterior probability from
# which an effect is said to be missing.
ALPHA = 0.05
SURE = 0.8
STARTS = 10
# A point that gets less than this share of the mean film was hardly reached by the path.
REACHED = 0.02
MOST_UNREACHED = 0.1
# Standard deviations above the prediction from which the gauge found paint.
PAINTED = 3.0
# Probability of residuals this small: below it the noise is overstated, or the readings were
# made up.
TOO_GOOD = 1e-4


class Run:
    """A fitted model, what has been added to it, and what may still be added.

    Attributes:
        study: the readings.
        fit: of the newest model.
        history: every model so far, the one started from first.
        accepted: the effects added so far, each with those confounded with it.
        candidates: effects that may be added, at neutral amplitude and in a few shapes, by id.
        trouble: why the fit cannot be right, '' if it can.
    """

    def __init__(
        self,
        campaign: Campaign,
        start: DepositionModel,
        library: Mapping[str, type[Effect]],
        seed: int,
        progress: Callable[[str], None],
    ) -> None:
        self.candidates = {
            key: neutral_shapes(effect)
            for key, effect in library.items()
            if start.effect(key) is None
        }
        neutral = (shapes[0] for shapes in self.candidates.values())
        self.study = Study.of(campaign, (*start.effects, *neutral))
        self.seed = seed
        progress('fitting the model')
        parameters = FreeParameters.of(start, *start.effects)
        self.fit = self.study.fit(parameters, STARTS, seed, self.study.nuisance)
        self.history = [Step.of(self.study, '', self.fit)]
        self.accepted: list[EffectClass] = []
        self.trouble = trouble_with(self.study, self.fit)
        self._excluded: list[Sensitivity] = []

    def linearise(self) -> Linearisation:
        """The evidence about what is missing from the newest model."""
        return linearise(self.study, self.fit, self.candidates, self._excluded, self.seed)

    def add(self, found: ConfoundedClass, linear: Linearisation) -> None:
        """Add the best effect of a class.

        The effects confounded with it are no candidates any longer, and what they could explain
        counts as nuisance in later rounds.
        """
        step = Step.of(self.study, found.best, found.fit)
        self.accepted.append(self.described(found, step))
        self.history.append(step)
        self.fit = found.fit
        self._excluded += [s for s in linear.sensitivities if s.id in found.members[1:]]
        for member in found.members:
            self.candidates.pop(member)

    def described(self, found: ConfoundedClass, after: Step) -> EffectClass:
        """A class with its intervals and the errors before and after adding its best effect."""
        return EffectClass(
            found.members,
            found.probability,
            found.best,
            intervals(found.fit, found.best),
            {'before': self.history[-1].holdout_rmse_um, 'after': after.holdout_rmse_um},
        )

    def diagnosis(
        self,
        first: Linearisation | None,
        verdict: Verdict,
        reason: str,
        others: tuple[EffectClass, ...] = (),
        unknown: Unknown | None = None,
    ) -> Diagnosis:
        """Put the results together; ``first`` is None where nothing could be tested."""
        return Diagnosis(
            self.study,
            verdict,
            reason,
            first.space.p_value if first else np.nan,
            tuple(c.best for c in self.accepted),
            (*self.accepted, *others),
            tuple(self.history),
            unknown,
            first.not_testable if first else (),
            first.detectable if first else {},
        )


def intervals(fit: Fit, effect_id: str) -> dict[str, Interval]:
    """95 % intervals of an effect's amplitudes, within what is physical."""
    found = {}
    for estimate in estimates(fit.marginal):
        owner, _, parameter = estimate.name.partition('.')
        if owner == effect_id:
            found[parameter] = Interval(estimate.value, estimate.low, estimate.high)
    return found


def trouble_with(study: Study, fit: Fit) -> str:
    """Why the fit cannot be right, or nothing."""
    mean = float(np.mean(study.measured_um))
    painted = fit.residual > PAINTED
    bare = float(np.mean(painted & (fit.predicted_um < REACHED * mean)))
    freedom = len(study) - len(fit.vector)
    if freedom < 5:
        return (
            f'{len(study)} points cannot determine {len(fit.vector)} parameters; '
            'measure at 30 points or more'
        )
    if bare > MOST_UNREACHED:
        return (
            f'the recorded path leaves {100 * bare:.0f} % of the points bare, where '
            'the gauge found paint; check the trajectory, its trigger and the mesh frame'
        )
    if not fit.converged:
        return 'the fit did not converge; give a start model nearer to the bell in use'
    if study.noise.source != 'assumed':
        reduced = fit.chi_square / freedom
        chance = f_ratio.cdf(reduced, freedom, min(study.noise.degrees_of_freedom, 1e6))
        if chance < TOO_GOOD:
            return (
                f'the readings scatter about the model {np.sqrt(reduced):.2f} times as much as '
                f'their noise says ({study.noise.source}); give their true sigma_um or repeats'
            )
    return ''
