"""Which of many places to measure: exchange of places for a design that finds effects.

Readings are linear in the pattern's parameters and in the amplitudes of the effects. What an
effect changes at the chosen places beyond what the pattern can imitate is its noncentrality (D_s-
optimality), and what another effect beside the pattern cannot imitate of it is their separation
(T-optimality: Atkinson and Fedorov, Biometrika 62, 1975). A design is worth the probability that
an effect is detected and separated from its nearest rival, averaged over the effects and over the
sizes in which they occur: a sum of the squares would go on improving what is seen anyway. Places
are added one by one and then exchanged (Fedorov, Theory of Optimal Experiments, 1972).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import ndtr, ndtri

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.inference.diagnosis.discrepancy import ModelDiscrepancy
from paint_deposition.inference.diagnosis.explanations import (
    neutral_shapes,
    nonparametric_laws_of,
    of_effects,
)
from paint_deposition.inference.diagnosis.gaussian import NullModel
from paint_deposition.inference.diagnosis.model_space import SIZES, EffectEvidence
from paint_deposition.inference.diagnosis.testability import LEVEL
from paint_deposition.inference.fitting.forward import Forward
from paint_deposition.inference.fitting.least_squares import Fit
from paint_deposition.inference.fitting.parameters import FreeParameters
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.posterior import Posterior
from paint_deposition.inference.readings.campaign import Campaign, Experiment
from paint_deposition.inference.readings.readings import Readings
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.surface import Surface


@dataclass(frozen=True)
class UnmeasuredPart:
    """A part as it was, or will be, painted."""

    surface: Surface
    path: SprayPath  # sub-steps of the gun's motion
    model: DepositionModel  # as far as it is known
    library: Mapping[str, type[Effect]]  # effects that may be missing, by id
    known: Posterior | None = None  # what is known of the model from earlier readings, or None

    @cached_property
    def candidates(self) -> dict[str, list[Effect]]:
        """Effects that the model does not have, neutral and in a few shapes, by id."""
        return {
            key: neutral_shapes(effect)
            for key, effect in self.library.items()
            if self.model.effect(key) is None
        }

    @cached_property
    def film_um(self) -> np.ndarray:
        """(V,) film that the model predicts at the vertices [um]."""
        surface = self.surface
        painted = FilmIntegrator(surface.points(), self.model, occluder=surface.occluder)
        painted.add(self.path)
        return painted.film_um

    def study(self, vertices: np.ndarray) -> Study:
        """Readings of the predicted film at these vertices (P,), by a gauge of the usual noise."""
        surface, count = self.surface, len(vertices)
        readings = Readings.of(
            surface.vertices_m[vertices], np.zeros(count), normals=surface.normals[vertices]
        )
        bare = Experiment.of('part', surface, self.path, readings)
        neutral = tuple(shapes[0] for shapes in self.candidates.values())
        effects = (*self.model.effects, *neutral)
        film_um = Forward(Campaign((bare,)), effects).predict_um(self.model)
        painted = bare.read_as(replace(readings, thickness_um=film_um))
        return Study.of(Campaign((painted,)), effects)

    def fit(self, study: Study) -> Fit:
        """The model beside readings that are as it predicts."""
        parameters = FreeParameters.of(self.model, *self.model.effects, known=self.known)
        return study.beside(parameters, parameters.encode(parameters.start))

    def space(self, study: Study, freedom: float) -> EffectEvidence:
        """What the diagnosis would search.

        Args:
            freedom: degrees of freedom of the noise estimate.
        """
        fit = self.fit(study)
        discrepancy = ModelDiscrepancy.of(study, fit)
        nature = [sizes for sizes in discrepancy.choices() if not sizes.is_beyond_nature]
        usual = max(nature, key=lambda sizes: sizes.log_prior)
        null = NullModel.around(fit, study.nuisance, discrepancy=discrepancy.covariance(usual))
        found = [
            *of_effects(study, fit, self.candidates),
            *nonparametric_laws_of(study, fit.model),
        ]
        return EffectEvidence(null, found, freedom)


@dataclass(frozen=True)
class CandidateDesign:
    """What readings at C places would show, over their noise."""

    # (C, k) change with each parameter of the model, in standard deviations of its prior.
    free: np.ndarray
    columns: np.ndarray  # (C, m) change with each amplitude of the effects at its typical size
    effects: np.ndarray  # (m,) id of the effect of each column

    @property
    def weights(self) -> np.ndarray:
        """(m,) share of each column in the mean over effects."""
        names, owner, count = np.unique(self.effects, return_inverse=True, return_counts=True)
        return 1.0 / (len(names) * count[owner])

    def around(self, chosen: np.ndarray) -> 'Design':
        """The design with the places of these rows (n,)."""
        free, columns = self.free[chosen], self.columns[chosen]
        covariance = np.linalg.inv(np.eye(free.shape[1]) + free.T @ free)
        slopes = covariance @ (free.T @ columns)
        information = columns.T @ columns - (columns.T @ free) @ slopes
        return Design(self, covariance, slopes, information)


@dataclass(frozen=True)
class Design:
    """Some of the places, the model refitted to their readings."""

    marks: CandidateDesign  # of all places
    covariance: np.ndarray  # (k, k) of the model's parameters
    slopes: np.ndarray  # (k, m) by which the parameters imitate each column
    information: np.ndarray  # (m, m) products of what they cannot imitate

    @property
    def noncentralities(self) -> np.ndarray:
        """(m,) squared signal-to-noise ratio of each column."""
        return np.maximum(np.diag(self.information), 0.0)

    def nearest(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(m,) nearest rival of each column, by how much it imitates, and the square left."""
        strength = self.noncentralities
        precision = strength + SIZES[-1] ** -2.0
        left = strength[:, np.newaxis] - self.information**2 / precision
        effects = self.marks.effects
        left[effects[:, np.newaxis] == effects] = np.inf
        rival = left.argmin(axis=1)
        rows = np.arange(len(rival))
        amount = self.information[rows, rival] / precision[rival]
        return rival, amount, np.clip(left[rows, rival], 0.0, strength)

    @property
    def worth(self) -> float:
        """Mean probability that an effect is detected, and separated from its nearest rival."""
        weights, tests = self.marks.weights, len(set(self.marks.effects))
        detected = weights @ power(self.noncentralities, tests)
        return float(0.5 * (detected + weights @ power(self.nearest()[2], tests)))

    def gains(self) -> np.ndarray:
        """(C,) by about how much one more reading at each place would raise the worth."""
        marks, tests = self.marks, len(set(self.marks.effects))
        left = marks.columns - marks.free @ self.slopes
        variance = 1.0 + np.einsum('ck,kl,cl->c', marks.free, self.covariance, marks.free)
        rival, amount, apart = self.nearest()
        detected = left**2 @ (marks.weights * slope(self.noncentralities, tests))
        separated = (left - amount * left[:, rival]) ** 2 @ (marks.weights * slope(apart, tests))
        return 0.5 * (detected + separated) / variance

    def shares(self, chosen: np.ndarray) -> np.ndarray:
        """(n, m) share of each column's noncentrality that would be lost without each place."""
        marks = self.marks
        free = marks.free[chosen]
        left = marks.columns[chosen] - free @ self.slopes
        kept = 1.0 - np.einsum('ck,kl,cl->c', free, self.covariance, free)
        return left**2 / kept[:, np.newaxis] / np.maximum(self.noncentralities, 1e-12)


def power(noncentrality: np.ndarray, tests: int) -> np.ndarray:
    """(m,) probability of detection, averaged over the sizes in which effects occur.

    Args:
        noncentrality: (m,) of effects of typical size.
        tests: how many effects share the level of the test.
    """
    limit = -ndtri(0.5 * LEVEL / tests)
    ratio = SIZES * np.sqrt(noncentrality)[:, np.newaxis]
    return np.mean(ndtr(ratio - limit) + ndtr(-ratio - limit), axis=1)


def slope(noncentrality: np.ndarray, tests: int) -> np.ndarray:
    """(m,) derivative of ``power`` by the noncentrality."""
    step = 1e-3 * (1e-3 + noncentrality)
    return (power(noncentrality + step, tests) - power(noncentrality, tests)) / step


def exchanged(
    marks: CandidateDesign, positions_m: np.ndarray, count: int, apart_m: float
) -> np.ndarray:
    """(n,) rows of the best places found, at least ``apart_m`` from each other [m].

    Args:
        marks: of C places. positions_m: (C, 3) [m].
        count: how many are wanted; fewer are found only where no more fit.
    """
    distance = np.linalg.norm(positions_m[:, np.newaxis] - positions_m, axis=2)
    near = distance < apart_m

    def best_beside(chosen: list[int]) -> tuple[int, Design]:
        design = marks.around(np.array(chosen, dtype=int))
        free = ~near[chosen].any(axis=0)
        return int(np.argmax(np.where(free, design.gains(), -1.0))) if free.any() else -1, design

    chosen: list[int] = []
    while len(chosen) < count and (best := best_beside(chosen)[0]) >= 0:
        chosen.append(best)
    worth = marks.around(np.array(chosen)).worth
    for _ in range(4):
        before = worth
        for row in chosen:
            others = [one for one in chosen if one != row]
            best = best_beside(others)[0]
            trial = marks.around(np.array([*others, best])).worth
            # A smaller gain in worth is not worth an exchange.
            if trial > worth + 1e-5:
                chosen, worth = [*others, best], trial
        if worth <= before:
            break
    return np.array(chosen, dtype=int)
