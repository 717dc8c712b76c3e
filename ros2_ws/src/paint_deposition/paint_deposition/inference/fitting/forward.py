"""The forward model: predictions at a campaign's points, fast enough to fit with."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache

import numpy as np
from scipy.linalg import block_diag

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.common_film import sum_um
from paint_deposition.film.integrator import (
    FEW_RAYS,
    FilmIntegrator,
    Steps,
    after_effects,
)
from paint_deposition.film.layout import term_weights
from paint_deposition.inference.readings.campaign import Campaign, Experiment
from paint_deposition.kernel.blocks import LANES, THREADS
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.part.points import SurfacePoints

# Where effects act that are laws of the flux.
LAWS = ('flux_factor', 'pattern_scale')
# Effects on film and gauge are differentiated by a step of this share of a unit.
STEP = 1e-4
# (P,) gauge readings [um] for (7 B,) weights of the films' terms, see ``layout.term_weights``.
OfWeights = Callable[[np.ndarray], np.ndarray]


class Forward:
    """Predictions at the P points of a campaign in double precision.

    Args:
        campaign: what was painted and where it was measured.
        effects: effects that will be varied; their laws are compiled once, together.
    """

    def __init__(self, campaign: Campaign, effects: tuple[Effect, ...] = ()) -> None:
        self.campaign, self.effects = campaign, effects
        # A model without one of them has it absent; what cannot be absent is not in its kernel.
        absent = (effect.absent for effect in effects if effect.acts(*LAWS))
        in_kernel = {effect.id: effect for effect in absent if effect.is_neutral}
        self._parts = [_Part(experiment, in_kernel) for experiment in campaign.experiments]
        # Where the integral is short, threads wait for each other longer than for it.
        rays = sum(len(experiment) * len(experiment.path) for experiment in campaign.experiments)
        threads = min(THREADS, len(self._parts)) if rays > FEW_RAYS else 1
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None

    def predict_um(self, model: DepositionModel) -> np.ndarray:
        """(P,) gauge readings that the model predicts [um], experiments one after the other."""
        models = self._models(model)
        return self._gauge_reading_um(self._each(_Part.film_um, models), models)

    def of_weights(self, model: DepositionModel) -> OfWeights:
        """The readings by the pattern's gains, for r, sigma1, sigma2 and effects of a model."""
        models = self._models(model)
        terms = self._each(_Part.terms, models)
        return lambda w: self._gauge_reading_um([w @ part for part in terms], models)

    def _each(
        self, work: Callable[['_Part', DepositionModel], np.ndarray], models: list[DepositionModel]
    ) -> list[np.ndarray]:
        return list((self._pool.map if self._pool else map)(work, self._parts, models))

    def _gauge_reading_um(
        self, films_um: list[np.ndarray], models: list[DepositionModel]
    ) -> np.ndarray:
        return np.concatenate([
            part.gauge_reading_um(film, one)
            for part, film, one in zip(self._parts, films_um, models, strict=True)
        ])  # fmt: skip

    def _models(self, model: DepositionModel) -> list[DepositionModel]:
        """The model of each part: without the effects of what was switched off."""
        return [model.without(part.experiment.switched_off) for part in self._parts]


def derivatives_by_pattern(
    readings_of: OfWeights, patterns: Sequence[PlanarPattern]
) -> tuple[np.ndarray, np.ndarray]:
    """(P,) readings and (P, 7 B) their derivatives by the patterns, see ``layout`` [um]."""
    weights = [term_weights(planar) for planar in patterns]
    film = np.concatenate([film for film, _ in weights])
    rows = block_diag(*(rows for _, rows in weights))
    ends = [(readings_of(film + STEP * w), readings_of(film - STEP * w)) for w in rows]
    slopes = np.column_stack([(above - below) / (2.0 * STEP) for above, below in ends])
    return readings_of(film), slopes


class _Part:
    """One experiment, integrated at its points alone or with the stencils of the film's slope."""

    def __init__(self, experiment: Experiment, in_kernel: dict[str, Effect]) -> None:
        self.experiment, self._in_kernel = experiment, in_kernel
        self._integrators: dict[bool, FilmIntegrator] = {}
        self._paths = [experiment.path.select(rows) for _, rows in experiment.films]
        # Films and prepared paths depend on less than the model: many models share one.
        self._film_um = lru_cache(8)(self._integrated_um)
        self._steps = lru_cache(2)(self._prepared)

    def points(self, slope: bool) -> SurfacePoints:
        """The P measured points, followed by the stencils where the slope is needed."""
        return self.experiment.points if slope else self.experiment.measured_points

    def film_um(self, model: DepositionModel) -> np.ndarray:
        """(F V,) what arrived at the points [um], one wet film after the other."""
        return self._film_um(*self._arriving(model))

    def terms(self, model: DepositionModel) -> np.ndarray:
        """(7 B, F V) terms of these films."""
        arriving, slope = self._arriving(model)
        integrator, films = self._ready(arriving, slope)
        count = len(self.points(slope))
        return np.hstack([integrator.terms(steps)[:, :count] for steps in films])

    def gauge_reading_um(self, films_um: np.ndarray, model: DepositionModel) -> np.ndarray:
        """(P,) gauge readings [um] of what arrived."""
        films = self.experiment.films
        points = self.points(any(effect.needs_slope for effect in model.effects))
        finished = (
            (sign, after_effects('on_film', film_um, model.effects, points))
            for (sign, _), film_um in zip(films, films_um.reshape(len(films), -1), strict=True)
        )
        reading = after_effects('on_gauge', sum_um(finished), model.effects, points)
        return reading[: len(self.experiment)]

    def _arriving(self, model: DepositionModel) -> tuple[DepositionModel, bool]:
        """The model with what acts before the film has arrived, which must be integrated again.

        Then whether one of its effects needs the film's slope.
        """
        early = ('on_path', 'widening', 'shadow', *LAWS)
        before = [e for e in model.effects if e.acts(*early) and not e.is_neutral]
        laws = {effect.id: effect for effect in before if effect.acts(*LAWS)}
        if laws:
            # All laws in a fixed order, absent ones neutral: one kernel, beside that without laws.
            others = [effect for effect in before if effect.id not in laws]
            before = [*others, *(self._in_kernel | laws).values()]
        slope = any(effect.needs_slope for effect in model.effects)
        return model.model_copy(update={'effects': tuple(before)}), slope

    def _integrated_um(self, model: DepositionModel, slope: bool) -> np.ndarray:
        integrator, films = self._ready(model, slope)
        arrived = []
        for steps in films:
            integrator.reset()
            integrator.paint(steps)
            arrived.append(integrator.raw_um[: len(self.points(slope))])
        film_um = np.concatenate(arrived)
        film_um.flags.writeable = False  # the next model reads it, too
        return film_um

    def _ready(self, model: DepositionModel, slope: bool) -> tuple[FilmIntegrator, list[Steps]]:
        integrator = self._integrators.get(slope)
        if integrator is None:
            points = self.points(slope)
            # Points left over from the kernel's SIMD lanes would cost several times their share.
            filled = np.pad(np.arange(len(points)), (0, -len(points) % LANES), 'edge')
            integrator = self._integrators[slope] = FilmIntegrator(
                points.select(filled), model, 'double', self.experiment.surface,
                keep_absent_laws=True, parallel=False,
            )  # fmt: skip
        integrator.use(model)
        moving = tuple(e for e in model.effects if e.acts('on_path'))
        return integrator, self._steps(slope, model.projection, moving, model.shadow > 0.0)

    def _prepared(self, slope: bool, *_: object) -> list[Steps]:
        """The path of each wet film as the integrator's effects have it."""
        integrator = self._integrators[slope]
        integrator.reset()
        return [integrator.steps(path) for path in self._paths]
