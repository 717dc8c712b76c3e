"""The explanations that compete for a diagnosis, and what they predict for further readings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.inference.diagnosis.discrepancy import PRIOR
from paint_deposition.inference.diagnosis.explanations import (
    FACTOR,
    FOOTPRINT,
    LAW_LENGTH,
    UNKNOWN,
    neutral_shapes,
    sensitivity,
)
from paint_deposition.inference.diagnosis.gaussian import NullModel
from paint_deposition.inference.diagnosis.separation import Predicted
from paint_deposition.inference.diagnosis.smooth_laws import RADII, footprint_along
from paint_deposition.inference.diagnosis.verdict import Diagnosis
from paint_deposition.inference.fitting.forward import Forward
from paint_deposition.inference.fitting.least_squares import Fit, derivatives
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.campaign import Campaign, Experiment
from paint_deposition.inference.readings.covariates import Covariate, Rays

# Effects that compete at the most.
MOST_RIVALS = 6
# Standard deviation of a shapeless cause's amplitudes, in its typical ones.
LARGE = 3.0
# Smooth functions are spanned by their values at knots over this many standard deviations of the
# covariate to either side.
REACH, KNOT_STEP = 3.0, 0.75
# Covariates are averages over the path; every so manieth sub-step is enough for them.
THINNED = 6


@dataclass(frozen=True)
class Rival:
    """One explanation that competes."""

    name: str  # effect id, ``UNKNOWN`` or ``FOOTPRINT``
    # As fitted, or neutral in the shape that fits best; None for a shapeless cause.
    effect: Effect | None
    # Covariates over which the law may be off, or of which the shapeless cause is a function.
    along: tuple[str, ...]


@dataclass(frozen=True)
class Rivals:
    """All explanations that compete, linear around one fit."""

    study: Study
    fit: Fit  # where to linearise; what competes may be part of its model
    found: tuple[Rival, ...]  # the explanations
    here: tuple[Predicted, ...]  # what each predicts for the readings at hand
    # Mean and standard deviation of each covariate at the readings at hand.
    scales: Mapping[str, tuple[float, float]]

    @staticmethod
    def of(study: Study, fit: Fit, names: Mapping[str, type[Effect] | str]) -> 'Rivals':
        """Fit each explanation to the readings beside everything else that the model has.

        Args:
            fit: where to linearise.
            names: for each the effect, or the covariate of a shapeless cause.
        """
        rays = study.rays(fit.model)
        values = study.covariates(fit.model)
        scales = {c.name: (float(c.values.mean()), float(c.values.std())) for c in values
                  if c.varies}  # fmt: skip
        empty = Rivals(study, fit, (), (), scales)
        null = NullModel.around(fit, study.nuisance, frozenset(names))
        found, here = [], []
        for name, effect in names.items():
            options = _options(name, effect, fit.model, scales)
            fits = [
                empty.predicted(option, study.forward, study.sigma_um, rays)
                .fitted(null.columns, null.raw)
                .at_least_typical()
                for option in options
            ]
            if fits:
                best = int(np.argmin([_left(null, predicted) for predicted in fits]))
                found.append(options[best])
                here.append(fits[best])
        return replace(empty, found=tuple(found), here=tuple(here))

    @property
    def names(self) -> tuple[str, ...]:
        """Of what competes."""
        return tuple(rival.name for rival in self.found)

    def free(self, jacobian: np.ndarray) -> np.ndarray:
        """(P, k) unit-variance directions of all parameters but those of what competes.

        Args:
            jacobian: (P, n) derivative of readings by all parameters, over the noise.
        """
        parameters = self.fit.parameters
        pattern = jacobian.shape[1] - len(parameters.of_effects)
        others = [entry.effect not in self.names for entry in parameters.of_effects]
        kept = np.array([True] * pattern + others)
        return jacobian[:, kept] @ parameters.prior.factor[np.ix_(kept, kept)]

    def nuisance_at(self, forward: Forward, sigma_um: np.ndarray) -> np.ndarray:
        """The same directions for other readings."""
        fit = self.fit
        return self.free(derivatives(forward, fit.parameters, fit.vector, sigma_um))

    def predictions_at(
        self, campaign: Campaign, forward: Forward, sigma_um: np.ndarray
    ) -> tuple[Predicted, ...]:
        """What each explanation, as found, predicts for other readings."""
        rays = [_thinned(experiment, self.fit) for experiment in campaign.experiments]
        return tuple(
            replace(self.predicted(rival, forward, sigma_um, rays), amounts=here.amounts)
            for rival, here in zip(self.found, self.here, strict=True)
        )

    def predicted(
        self,
        rival: Rival,
        forward: Forward,
        sigma_um: np.ndarray,
        rays: Sequence[Rays],
    ) -> Predicted:
        """What an explanation predicts, its amounts being 0."""
        if rival.name == FOOTPRINT:
            basis = footprint_along(rays, self.fit.model.patterns)
            random = basis.random(FACTOR, PRIOR.footprint_lengths[0] * RADII)
            return _shapeless(random.change_um / sigma_um[:, np.newaxis])
        values = (
            Covariate(same[0].name, np.concatenate([part.values for part in same]))
            for same in zip(*(part.covariates for part in rays), strict=True)
        )
        along = {c.name: self._functions(c) for c in values if c.name in rival.along}
        functions = [along[name] / np.sqrt(len(along)) for name in rival.along if name in along]
        count = len(sigma_um)
        smooth = np.hstack([np.empty((count, 0)), *functions])
        if rival.effect is not None:
            law = sensitivity(forward, self.fit, rival.effect, sigma_um)
            none = np.zeros(len(law.low))
            return Predicted(law.columns, smooth, none, law.low, law.high)
        film = forward.predict_um(self.fit.model)
        return _shapeless((FACTOR * film / sigma_um)[:, np.newaxis] * smooth)

    def _functions(self, covariate: Covariate) -> np.ndarray:
        """(P, n) smooth random functions of a covariate, of unit variance within its range."""
        mean, spread = self.scales[covariate.name]
        knots = np.arange(-REACH, REACH + KNOT_STEP, KNOT_STEP * LAW_LENGTH)
        at = np.clip((covariate.values - mean) / spread, -REACH, REACH)
        lower = cholesky(_bell(knots, knots) + 1e-6 * np.eye(len(knots)), lower=True)
        return solve_triangular(lower, _bell(at, knots).T, lower=True).T


def rivals_of(diagnosis: Diagnosis, library: Mapping[str, type[Effect]]) -> Rivals | None:
    """What competes for a diagnosis: None if nothing does.

    These are the members of the first group that has several; else, where nothing is accepted,
    the leading effects and the shapeless cause, if that is what the verdict names. A pattern that
    is no two Gaussians may always stand in their place.
    """
    names = _competing(diagnosis, library)
    if not names:
        return None
    wanted: dict[str, type[Effect] | str] = {n: library[n] for n in names}
    if diagnosis.unknown is not None:
        wanted[UNKNOWN] = diagnosis.unknown.covariate
    wanted[FOOTPRINT] = FOOTPRINT
    rivals = Rivals.of(diagnosis.study, diagnosis.history[-1].fit, wanted)
    return rivals if len(rivals.names) > 1 else None


def _competing(diagnosis: Diagnosis, library: Mapping[str, type[Effect]]) -> tuple[str, ...]:
    several = [
        tuple(m for m in found.members if m in library)
        for found in diagnosis.classes
        if len(found.members) > 1
    ]
    if several:
        return several[0][:MOST_RIVALS]
    if any(found in library for found in diagnosis.accepted):
        return ()
    return tuple(c.best for c in diagnosis.classes if c.best in library)[:MOST_RIVALS]


def _options(
    name: str,
    effect: type[Effect] | str,
    model: DepositionModel,
    scales: Mapping[str, tuple[float, float]],
) -> list[Rival]:
    """The shapes in which a cause explains."""
    if name == FOOTPRINT:
        return [Rival(name, None, ())]
    if isinstance(effect, str):
        return [Rival(name, None, (effect,))] if effect in scales else []
    own = tuple(c for c in effect.covariates if c in scales)
    fitted = model.effect(name)
    return [Rival(name, shape, own) for shape in ([fitted] if fitted else neutral_shapes(effect))]


def _left(null: NullModel, predicted: Predicted) -> float:
    """Square of the deviations that an explanation leaves."""
    return float(np.sum(null.whiten((null.raw - predicted.change)[:, np.newaxis]) ** 2))


def _shapeless(columns: np.ndarray) -> Predicted:
    """What a shapeless cause predicts with directions (P, n) over the noise."""
    most = np.full(columns.shape[1], np.inf)
    return Predicted(
        columns, np.empty((len(columns), 0)), 0.0 * columns[0], -most, most, LARGE**-2.0
    )  # fmt: skip


def _thinned(experiment: Experiment, fit: Fit) -> Rays:
    path = experiment.path
    thin = path.select(slice(None, None, THINNED))
    thin = thin.with_(dwell_s=THINNED * thin.dwell_s)
    return Rays.of(replace(experiment, path=thin), fit.model)


def _bell(at: np.ndarray, knots: np.ndarray) -> np.ndarray:
    return np.exp(-0.5 * ((at[:, np.newaxis] - knots) / LAW_LENGTH) ** 2)
