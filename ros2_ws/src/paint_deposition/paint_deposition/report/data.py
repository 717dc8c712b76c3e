"""Figures and arrays that the report shows, computed once from the inference's results."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.common_film import sum_um
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.film.statistics import wanted_at
from paint_deposition.inference.comparison.comparison import Comparison, SideBySide
from paint_deposition.inference.comparison.profiles import Profile, profiles_of
from paint_deposition.inference.diagnosis.proposals import Place, Spray
from paint_deposition.inference.diagnosis.verdict import Diagnosis, Step
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.campaign import Experiment
from paint_deposition.inference.readings.readings import root_mean_square
from paint_deposition.report.style import ACCENT, BEFORE, INK, MODELS


class Change(NamedTuple):
    """Most negative, most positive (or 0) and RMS difference of two predictions [um]."""

    least_um: float
    most_um: float
    rms_um: float


class PredictedFilm(NamedTuple):
    """The layer of a part that was measured, with one model."""

    film_um: np.ndarray  # (V,) on the surface [um]
    emitted_cm3: float  # solids that a part which catches everything would get [cm3]


@dataclass(frozen=True)
class ReportData:
    """Everything the report is made of."""

    # Of the first and the best model; one where nothing was added.
    comparisons: tuple[Comparison, ...]
    diagnosis: Diagnosis | None = None  # or None after a comparison alone
    # History of the model that a diagnosis started from, as in its file.
    older: Sequence[Mapping[str, Any]] = ()
    # Of models that stand side by side; none where one model followed from another.
    names: tuple[str, ...] = ()

    @staticmethod
    def of(
        result: Comparison | SideBySide | Diagnosis, older: Sequence[Mapping[str, Any]] = ()
    ) -> 'ReportData':
        """Gather what the report shows; of a diagnosis, the first and the last model."""
        if isinstance(result, SideBySide):
            return ReportData(tuple(result.by_name.values()), names=tuple(result.by_name))
        if isinstance(result, Comparison):
            return ReportData((result,))
        first, *later = result.comparisons
        return ReportData((first, *later[-1:]), result, older)

    @property
    def study(self) -> Study:
        """The readings."""
        return self.comparisons[0].study

    @property
    def experiments(self) -> tuple[Experiment, ...]:
        """The experiments of the campaign."""
        return self.study.campaign.experiments

    @cached_property
    def bands(self) -> list[str]:
        """Where the film measured at each point is beside its own target band; '' without one."""
        target_of, bands = self.study.campaign.target_of, []
        for one in self.experiments:
            measured = one.means.mean_um
            target, tolerance = wanted_at(measured, *target_of(one), one.zones_of_points)
            off = measured - target
            within = np.where(np.abs(off) <= tolerance, 'in', np.where(off < 0.0, 'low', 'high'))
            bands += np.where(np.isnan(off), '', within).tolist()
        return bands

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks for the user."""
        return self.diagnosis.notes if self.diagnosis else self.study.notes

    @property
    def models(self) -> tuple[DepositionModel, ...]:
        """Base first, best last."""
        return tuple(comparison.model for comparison in self.comparisons)

    @property
    def model(self) -> DepositionModel:
        """The best model."""
        return self.models[-1]

    @property
    def best(self) -> str:
        """Of models side by side the one with the smallest error."""
        errors = [comparison.points.rmse_um for comparison in self.comparisons]
        return self.names[int(np.argmin(errors))]

    @property
    def improved(self) -> bool:
        """Whether there is a before and an after."""
        return len(self.models) > 1 and not self.names

    @property
    def model_names(self) -> tuple[str, ...]:
        """What the models are called where both are shown."""
        return self.names or (('model before', 'model after') if self.improved else ('model',))

    @property
    def colours(self) -> tuple[str, ...]:
        """Colours of the models; a model before is paler than the one after it."""
        return MODELS[: len(self.models)] if self.names else (BEFORE, ACCENT)[-len(self.models) :]

    @property
    def lines(self) -> list[dict[str, Any]]:
        """Colour and width [px] of each model's line over readings.

        The line of a model before is thin and lies over the bold one, so that both are seen where
        they agree.
        """
        if self.names:
            return [{'color': colour, 'width': 2.2} for colour in self.colours]
        lines = [{'color': INK, 'width': 1.2}, {'color': ACCENT, 'width': 3.5}]
        return lines[-len(self.models) :]

    @property
    def proposals(self) -> tuple[Sequence[Place], Sequence[Spray]]:
        """What to measure and what to spray next."""
        return self.diagnosis.proposals if self.diagnosis else ((), ())

    @property
    def history(self) -> list[dict[str, Any]]:
        """History of the model, oldest step first, as in its file."""
        if self.diagnosis is None:
            return []
        return history_as_list(self.study, self.diagnosis.history, self.older)

    @cached_property
    def changes(self) -> dict[str, Change]:
        """What each effect that was added changes in the prediction at the points, by id.

        The model with it and the model without it are each fitted to all readings: what the
        pattern can imitate counts as no change.
        """
        steps = self.diagnosis.history if self.diagnosis else ()
        off = {s.added: s.fit.predicted_um - b.fit.predicted_um for b, s in pairwise(steps)}
        return {
            added: Change(min(um.min(), 0.0), max(um.max(), 0.0), root_mean_square(um))
            for added, um in off.items()
        }

    def effect_class(self, effect_id: str) -> type[Effect] | None:
        """An effect that was looked for or is in the models; None if it is neither."""
        own = {e.id: type(e) for model in self.models for e in model.effects}
        return (own | dict(self.diagnosis.library if self.diagnosis else {})).get(effect_id)

    @cached_property
    def residuals_um(self) -> list[np.ndarray]:
        """For each model (P,) at the points, averaged over repeats [um]."""
        return [c.points.residual_um for c in self.comparisons]

    @cached_property
    def profiles(self) -> list[Profile]:
        """Along columns and rows."""
        return profiles_of(self.study, self.models)

    @property
    def lined(self) -> bool:
        """Whether the readings lie in columns or rows, along which models can be drawn."""
        return all(len(profile.line_m) for profile in self.profiles)

    def rows_of(self, index: int) -> slice:
        """Points of the study that belong to an experiment."""
        first, stop = np.searchsorted(self.study.campaign.experiment_of, [index, index + 1])
        return slice(int(first), int(stop))

    @cached_property
    def painted(self) -> list[list[PredictedFilm]]:
        """The surface painted: for each experiment, with each model."""
        return [[_painted(one, model) for model in self.models] for one in self.experiments]


def _painted(experiment: Experiment, model: DepositionModel) -> PredictedFilm:
    surface, acting = experiment.surface, model.without(experiment.switched_off)
    points = surface.points()
    films = []
    for sign, rows in experiment.films:
        film = FilmIntegrator(points, acting, 'double', surface.occluder)
        film.add(experiment.path.select(rows))
        films.append((sign, film))
    return PredictedFilm(
        sum_um((sign, film.film_um) for sign, film in films),
        sum(sign * film.emitted_cm3 for sign, film in films),
    )


def history_as_list(
    study: Study, steps: Sequence[Step], older: Sequence[Mapping[str, Any]] = ()
) -> list[dict[str, Any]]:
    """What was added to a model and the errors it left.

    Errors can be compared within one campaign only, so each step names its campaign, with the
    noise of its gauge. The start model is the last of the older steps: refitted to the
    same campaign it replaces that step, fitted to another one it follows it.

    Args:
        study: the readings.
        steps: the models, the start model, refitted, first.
        older: what the start model's own file says.
    """
    campaign = study.campaign.name
    found = [
        {
            'added': step.added,
            'rmse_um': round(step.rmse_um, 4),
            'holdout_rmse_um': round(step.holdout_rmse_um, 4),
            'noise_floor_um': round(study.noise_floor_um, 4),
            'campaign': campaign,
        }
        for step in steps
    ]
    kept = [dict(step) for step in older]
    if kept and kept[-1].get('campaign', campaign) == campaign:
        found[0] = kept.pop() | found[0] | {'added': older[-1].get('added', 'pattern')}
    else:
        found[0]['added'] = 'refit' if kept or steps[0].model.effects else 'pattern'
    return [*kept, *found]
