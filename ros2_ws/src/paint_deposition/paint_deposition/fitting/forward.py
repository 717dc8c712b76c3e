"""The forward model: predictions at a campaign's points, fast enough to fit with."""

import numba
import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.readings.campaign import Campaign, Experiment


class Forward:
    """Predictions at the points of a campaign in double precision.

    Args:
        campaign: what was painted and where it was measured.
        effects: effects that will be varied; their laws are compiled once, together.
    """

    def __init__(self, campaign: Campaign, effects: tuple[Effect, ...] = ()) -> None:
        self.campaign, self.effects = campaign, effects
        # The compiled kernel has these laws in a fixed order; those a model lacks are neutral.
        self._in_kernel = tuple(e for e in effects if type(e).flux_factor or type(e).pattern_scale)
        self._parts = [_Part(experiment) for experiment in campaign.experiments]

    def predict_um(self, model: DepositionModel) -> np.ndarray:
        """(P,) gauge readings that the model predicts [um], experiments one after the other."""
        ids = {effect.id for effect in model.effects}
        idle = tuple(effect for effect in self._in_kernel if effect.id not in ids)
        if self._in_kernel:
            ranks = {effect.id: rank for rank, effect in enumerate(self._in_kernel)}
            model = model.model_copy(
                update={
                    'effects': tuple(
                        sorted((*model.effects, *idle), key=lambda e: ranks.get(e.id, -1))
                    )
                }
            )
        return np.concatenate([part.predict_um(model) for part in self._parts])


class _Part:
    """One experiment with its integrators, for models that need the film's slope and others."""

    def __init__(self, experiment: Experiment) -> None:
        self.experiment = experiment
        self._integrators: dict[bool, FilmIntegrator] = {}

    def predict_um(self, model: DepositionModel) -> np.ndarray:
        model = model.without(self.experiment.switched_off)
        with_stencils = any(effect.needs_slope for effect in model.effects)
        integrator = self._integrators.get(with_stencils)
        if integrator is None:
            one = self.experiment
            points = one.points if with_stencils else one.measured_points
            integrator = self._integrators[with_stencils] = FilmIntegrator(
                points, model, 'double', one.surface.occluder, keep_absent_laws=True
            )
        integrator.reset()
        integrator.use(model)
        threads = numba.get_num_threads()
        numba.set_num_threads(1)  # a hundred points are done before other threads have started
        try:
            integrator.add(self.experiment.path)
        finally:
            numba.set_num_threads(threads)
        return integrator.gauge_um[: len(self.experiment)]
