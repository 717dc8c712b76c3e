"""The readings of a campaign that inference rests on: without outliers, with the film's texture.

Comparison, diagnosis and calibration all take their readings from here.
"""

from dataclasses import replace

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.inference.fitting.condensing import MANY, condensed, thinned
from paint_deposition.inference.fitting.least_squares import Fit, on_one_thread
from paint_deposition.inference.fitting.mistaken_data import find_mistakes, fitted_points
from paint_deposition.inference.fitting.outliers import (
    FEWEST_POINTS,
    FittedPoints,
    Outlier,
    find_outliers,
)
from paint_deposition.inference.fitting.parameters import FreeParameters
from paint_deposition.inference.fitting.study import TEXTURE_SHARE, Study, Texture
from paint_deposition.inference.posterior import Posterior
from paint_deposition.inference.readings.campaign import Campaign

# Starts of the fit from which outliers are found.
STARTS = 3


@on_one_thread
def clean_and_fit(
    campaign: Campaign,
    start: DepositionModel,
    effects: tuple[Effect, ...] = (),
    starts: int = STARTS,
    seed: int = 0,
    known: Posterior | None = None,
) -> tuple[Study, Fit]:
    """A campaign prepared for inference without its outliers, and the pattern fitted to it.

    Readings by the thousand are condensed first, see ``condensing``.

    Args:
        start: first guess of the pattern; its effects are refitted, too.
        effects: those whose amplitudes may be varied later.

    Raises:
        ReadingsError: readings in another unit, with the remedy.
    """
    if len(campaign) > MANY:
        rough = _fitted(Study.of(thinned(campaign, seed), effects), start, starts, seed, known)
        campaign, start, starts = condensed(campaign, rough.model), rough.model, 1
    study = Study.of(campaign, effects)
    fit = _fitted(study, start, starts, seed, known)
    if not fit.predicted_um.any():
        return study, fit
    if len(study) >= FEWEST_POINTS:
        study, fit = _cleaned(study, fit, start, starts, seed, known)
    return replace(study, mistakes=find_mistakes(study, fit, start)), fit


def _cleaned(
    study: Study, fit: Fit, start: DepositionModel, starts: int, seed: int,
    known: Posterior | None,
) -> tuple[Study, Fit]:  # fmt: skip
    """The same without outliers, with the film's texture and what facets cost."""
    misfit = fitted_points(study, fit)
    if found := _outliers(study, fit, misfit):
        study = study.without(found)
        fit = _fitted(study, start, starts, seed, known)
        misfit = fitted_points(study, fit)
    texture = _texture(study, misfit)
    if texture != study.texture:
        study = replace(study, texture=texture)
        fit = _fitted(study, fit.model, 1, seed, known)
    faceted = study.with_facets(fit.model)
    if faceted is not study:
        return faceted, _fitted(faceted, fit.model, 1, seed, known)
    return study, fit


def _fitted(
    study: Study, start: DepositionModel, starts: int, seed: int, known: Posterior | None
) -> Fit:
    parameters = FreeParameters.of(start, *start.effects, known=known)
    return study.fit(parameters, starts, seed, study.nuisance)


def _outliers(study: Study, fit: Fit, misfit: FittedPoints) -> dict[int, Outlier]:
    means = study.campaign.means
    label = study.campaign.readings.point[means.first]
    film = study.measured_um
    return {
        row: Outlier(
            str(label[row]), float(film[row]), float(fit.predicted_um[row] + residual_um),
            sigma_um, *(() if other is None else (str(label[other]), float(film[other]))),
        )
        for row, (residual_um, sigma_um, other) in
        find_outliers(misfit, means.repeats == 1).items()
    }  # fmt: skip


def _texture(study: Study, misfit: FittedPoints) -> Texture:
    """Estimated where the gauge's noise is known.

    Only a texture finer than usual is accepted: a coarser one looks like anything that is missing
    from the model and narrower than the distance between readings.
    """
    if study.noise.source == 'assumed':
        return study.texture
    share = misfit.leave_one_out.texture_share
    return Texture(share, 'neighbours') if share < TEXTURE_SHARE else study.texture
