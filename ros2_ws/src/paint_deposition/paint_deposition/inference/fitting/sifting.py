"""The readings of a campaign that inference rests on: without slips, with the film's texture.

Comparison, diagnosis and calibration all take their readings from here.
"""

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.inference.fitting.least_squares import Fit
from paint_deposition.inference.fitting.one_thread import on_one_thread
from paint_deposition.inference.fitting.parameters import FreeParameters
from paint_deposition.inference.fitting.slips import FEWEST, Slip, slips
from paint_deposition.inference.fitting.smooth_misfit import Misfit
from paint_deposition.inference.fitting.study import TEXTURE_SHARE, Study, Texture
from paint_deposition.inference.posterior import Posterior
from paint_deposition.inference.readings.campaign import Campaign

# Starts of the fit beside which readings are judged.
STARTS = 3


@on_one_thread
def sifted(
    campaign: Campaign,
    start: DepositionModel,
    effects: tuple[Effect, ...] = (),
    starts: int = STARTS,
    seed: int = 0,
    known: Posterior | None = None,
) -> tuple[Study, Fit]:
    """A campaign prepared for inference without its slips, and the pattern fitted to it.

    Args:
        campaign: the readings and how the parts were painted.
        start: first guess of the pattern; its effects are refitted, too.
        effects: those whose amplitudes may be varied later.
        starts, seed: of the fit.
        known: of the parameters from another job.

    Raises:
        ReadingsError: readings in another unit, with the remedy.
    """
    study = Study.of(campaign, effects)
    fit = _fitted(study, start, starts, seed, known)
    if len(study) < FEWEST or not fit.predicted_um.any():
        return study, fit
    misfit = _misfit(study, fit)
    found = _slips(study, fit, misfit)
    if found:
        study = study.without(found)
        fit = _fitted(study, start, starts, seed, known)
        misfit = _misfit(study, fit)
    texture = _texture(study, misfit)
    if texture != study.texture:
        study = study.textured(texture)
        fit = _fitted(study, fit.model, 1, seed, known)
    faceted = study.with_facets(fit.model)
    if faceted is not study:
        study = faceted
        fit = _fitted(study, fit.model, 1, seed, known)
    return study, fit


def _fitted(
    study: Study, start: DepositionModel, starts: int, seed: int, known: Posterior | None
) -> Fit:
    parameters = FreeParameters.of(start, *start.effects, known=known)
    return study.fit(parameters, starts, seed, study.nuisance)


def _slips(study: Study, fit: Fit, misfit: Misfit) -> dict[int, Slip]:
    readings, means = study.campaign.readings, study.campaign.means
    found = slips(misfit, means.repeats == 1)
    return {
        row: Slip(
            str(readings.point[means.first[row]]),
            float(study.measured_um[row]),
            float(fit.predicted_um[row] + residual_um),
            sigma_um,
        )
        for row, (residual_um, sigma_um) in found.items()
    }


def _texture(study: Study, misfit: Misfit) -> Texture:
    """Estimated where the gauge's noise is known.

    Only a texture finer than usual is believed: a coarser one looks like anything that is missing
    from the model and narrower than the distance between readings.
    """
    if study.noise.source == 'assumed':
        return study.texture
    share = misfit.scatter.texture_share
    return Texture(share, 'neighbours') if share < TEXTURE_SHARE else study.texture


def _misfit(study: Study, fit: Fit) -> Misfit:
    free = np.hstack([fit.jacobian @ fit.parameters.prior.factor, study.nuisance])
    return Misfit(
        fit.residual * study.sigma_um,
        fit.predicted_um,
        study.gauge_um,
        free * study.sigma_um[:, np.newaxis],
        study.campaign.experiment_of,
        study.campaign.positions_m,
        tuple(study.covariates(fit.model)),
    )
