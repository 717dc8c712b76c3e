"""A part that was painted, or will be, and that nobody has measured yet."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.inference.diagnosis.discrepancy import ModelDiscrepancy
from paint_deposition.inference.diagnosis.explanations import (
    candidates_beside,
    nonparametric_laws_of,
    of_effects,
)
from paint_deposition.inference.diagnosis.gaussian import NullModel
from paint_deposition.inference.diagnosis.model_space import EffectEvidence
from paint_deposition.inference.diagnosis.testability import power_along
from paint_deposition.inference.fitting.forward import Forward
from paint_deposition.inference.fitting.least_squares import Fit
from paint_deposition.inference.fitting.parameters import FreeParameters, Posterior
from paint_deposition.inference.fitting.study import Study
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
        return candidates_beside(self.model, self.library)

    @cached_property
    def film_um(self) -> np.ndarray:
        """(V,) film that the model predicts at the vertices [um]."""
        surface = self.surface
        painted = FilmIntegrator(surface.points(), self.model, occluder=surface)
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
        # Readings that are as predicted say nothing of its size.
        usual = max(nature, key=lambda sizes: sizes.log_prior)
        null = NullModel.around(fit, study.nuisance, discrepancy=discrepancy.covariance(usual))
        found = [
            *of_effects(study, fit, self.candidates),
            *nonparametric_laws_of(study, fit.model),
        ]
        return EffectEvidence(null, found, freedom)

    def power(self, vertices: np.ndarray, freedom: float, seed: int = 0) -> dict[str, float]:
        """By effect, probability that the test of the diagnosis finds it at its typical size.

        The mean over its amplitudes and shapes.

        Args:
            vertices: (P,) where the part is read.
            freedom: degrees of freedom of the noise estimate.
        """
        space = self.space(self.study(vertices), freedom)
        draws = space.null_draws(seed)
        null, draws = space.evidence(draws), draws[:, :400]
        found: dict[str, list[float]] = {}
        for law in (e for e in space.explanations if e.law is not None):
            for column, side in zip(space.null.whiten(law.columns).T, law.sides, strict=True):
                strength = float(np.linalg.norm(column))
                direction = (-column if side < 0.0 else column) / max(strength, 1e-12)
                chance = power_along(space, direction, np.array([strength]), null, draws)[0]
                found.setdefault(law.cause, []).append(float(chance))
        return {name: float(np.mean(chances)) for name, chances in sorted(found.items())}
