"""The posterior of a fit: the prior of the next job, and models drawn from it.

A campaign starts from the brushes that painted it, and from what is known of these.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag
from scipy.special import chdtri

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.learned_curves import LearnedCurve
from paint_deposition.effects.learned_laws import LearnedFootprint
from paint_deposition.errors import ModelError, ReadingsError
from paint_deposition.inference.fitting.estimates import DiscrepancyFigures, scaled_covariance
from paint_deposition.inference.fitting.least_squares import Fit
from paint_deposition.inference.fitting.parameters import FreeParameters, Posterior
from paint_deposition.inference.fitting.pattern_vector import PatternVector
from paint_deposition.inference.fitting.random_effects import LEVEL_SHARE
from paint_deposition.inference.readings.campaign import Campaign
from paint_deposition.model.eq1_pattern import Brush, listed
from paint_deposition.motion.trajectory import ONLY_BRUSH


def posterior_of(
    fit: Fit,
    campaign: Campaign,
    figures: DiscrepancyFigures | None = None,
    shifts: np.ndarray | None = None,
) -> Posterior:
    """The posterior of a fit to a campaign, widened as ``scaled_covariance`` is.

    It is as narrow as that of the best fit beside the discrepancy.

    Args:
        figures: of the discrepancy, if they are known. Where the fit has learned the footprint,
            it is off by as much as the readings leave open.
    """
    footprint = figures and figures.footprint_size
    if figures and fit.model.effect(LearnedFootprint.id):
        footprint = float(np.sqrt(np.mean(figures.profile.sd**2))), 2.0
    if footprint:
        footprint = float(f'{footprint[0]:.3g}'), float(f'{footprint[1]:.3g}')
    parameters = fit.parameters
    scale, shifts = parameters.scale, with_mean_level(fit, campaign, shifts)
    covariance = scaled_covariance(fit.marginal, shifts) * np.outer(scale, scale)
    known = parameters.known.readings if parameters.known else ()
    return Posterior.of(
        parameters.coordinates, parameters.offset + scale * fit.vector,
        0.5 * (covariance + covariance.T), readings=(*known, *campaign.fingerprints),
        process=campaign.settings, footprint=footprint,
    )  # fmt: skip


def with_mean_level(fit: Fit, campaign: Campaign, shifts: np.ndarray | None = None) -> np.ndarray:
    """(n, k) shifts of a fit's vector, and that by which the parts' mean level may be off."""
    levels, pattern = np.zeros((1, len(fit.vector))), fit.parameters.pattern
    log_k1 = [pattern.entries(row)[0] for row in range(pattern.count)]
    levels[0, log_k1] = LEVEL_SHARE / np.sqrt(len(campaign.experiments))
    return levels if shifts is None else np.vstack([shifts, levels])


def of_brushes(
    known: Posterior | None, given: DepositionModel, start: DepositionModel
) -> Posterior | None:
    """The posterior of the brushes that painted a campaign.

    Where nothing was calibrated, a model with several brushes still says how they differ: their
    level and size are open, and each may differ from the others as much as jobs do.

    Args:
        known: of the given model, or None. given: as it was read.
        start: with the brushes of the campaign only.
    """
    kept = PatternVector(tuple(brush.number for brush in start.brushes))
    whole = PatternVector(tuple(brush.number for brush in given.brushes))
    if known is not None and {c.name for c in whole.coordinates} <= set(known.names):
        return _select(known, whole, kept)
    if kept.count == 1 or not given.brushes:
        return None
    deviations = np.array([c.between_jobs for c in kept.coordinates])
    width = np.array([c.width for c in kept.coordinates])
    covariance = kept.shared_covariance(width) + np.diag(deviations**2)
    names = [c.name for c in kept.coordinates]
    return Posterior.of(names, np.array(kept.encode(start.patterns)), covariance)


def _select(known: Posterior, whole: PatternVector, kept: PatternVector) -> Posterior:
    """The posterior of some brushes out of that of all; the rest of it stays."""
    if whole.brushes == kept.brushes:
        return known
    names = [c.name for c in whole.coordinates]
    of_effects = [name for name in known.names if name not in names]
    entries, slope = kept.subset(whole, np.array([known.mean[name] for name in names]))
    mean = np.concatenate([entries, [known.mean[name] for name in of_effects]])
    linear = block_diag(slope, np.eye(len(of_effects)))
    order = [known.names.index(name) for name in (*names, *of_effects)]
    matrix = linear @ known.matrix[np.ix_(order, order)] @ linear.T
    new = [*(c.name for c in kept.coordinates), *of_effects]
    of = {name: getattr(known, name) for name in ('readings', 'process', 'footprint')}
    return Posterior.of(new, mean, matrix, **of)


def prior_for(
    known: Posterior | None, campaign: Campaign
) -> tuple[Posterior | None, tuple[str, ...]]:
    """What may serve as the prior for a campaign, and a remark where it may not.

    No reading counts twice: a posterior that rests on readings of the campaign is none.
    """
    if known is None:
        return None, ()
    behind = set(known.readings)
    both = zip(campaign.experiments, campaign.fingerprints, strict=True)
    twice = [experiment.name for experiment, fingerprint in both if fingerprint in behind]
    if twice:
        return None, (
            f'The posterior of the model file rests on the readings of '
            f'{", ".join(twice)} themselves and is not used; give the model that was calibrated '
            'without them.',
        )
    return known, tuple(
        f'The model was calibrated at {name} {then:g}, this job was painted at {now:g}: its '
        'pattern may differ by more than jobs do.'
        for name, then in known.process.items()
        for now in [campaign.settings.get(name, then)]
        if abs(now - then) > 0.05 * abs(then)
    )


# If fewer draws than one in so many are physical, the posterior belongs to another model.
MOST_ROUNDS = 1000


def draw_models(
    model: DepositionModel, posterior: Posterior, count: int, seed: int
) -> list[DepositionModel]:
    """So many models from the posterior of a model, the normal distribution within its bounds.

    Draws with a value outside its bounds are repeated, so that none pile up at a bound. Learned
    curves vary independently, within their band.

    Args:
        model: that the posterior belongs to; it has every effect that the posterior names.

    Raises:
        ModelError: next to no draw lies within the bounds.
    """
    varied = [
        (effect.id, name)
        for effect in model.effects
        for name, coordinate in effect.coordinates().items()
        if f'{effect.id}.{coordinate}' in posterior.names
    ]
    parameters = FreeParameters(model, tuple(varied))
    order = [posterior.names.index(name) for name in parameters.coordinates]
    covariance = posterior.matrix[np.ix_(order, order)]
    rng = np.random.default_rng(seed)
    vectors = np.empty((0, len(order)))
    for _ in range(MOST_ROUNDS):
        values = rng.multivariate_normal(
            posterior.centre[order], covariance, count, method='cholesky'
        )
        fresh = (values - parameters.offset) / parameters.scale
        vectors = np.concatenate([vectors, fresh[parameters.are_physical(fresh)]])
        if len(vectors) >= count:
            break
    else:
        raise ModelError(
            f'posterior: of {MOST_ROUNDS * count} draws {len(vectors)} are within the bounds of '
            'the parameters; copy the section from the file that was written for this model'
        )
    models = [parameters.decode(vector) for vector in vectors[:count]]
    return [
        one.model_copy(update={'effects': tuple(_draw_curve(law, rng) for law in one.effects)})
        for one in models
    ]


def _draw_curve(effect: Effect, rng: np.random.Generator) -> Effect:
    """A learned curve drawn from its band; any other effect as it is."""
    if not (isinstance(effect, LearnedCurve) and effect.sd):
        return effect
    knots = np.arange(len(effect.sd))
    # Values so many knots apart have nearly independent errors.
    apart = np.subtract.outer(knots, knots) / 2.0
    covariance = np.exp(-0.5 * apart**2) * np.outer(effect.sd, effect.sd)
    learned = rng.multivariate_normal(effect.learned, covariance, method='eigh')
    return effect.model_copy(update={'learned': tuple(learned.tolist())})


@dataclass(frozen=True)
class PatternShift:
    """Distance between the fitted pattern and the calibrated one."""

    # Mahalanobis distance, in standard deviations of what was known before: the calibration's
    # posterior, widened by what differs between jobs.
    distance: float
    by_coordinate: dict[str, float]  # signed, of each coordinate alone

    @staticmethod
    def of(fit: Fit) -> PatternShift | None:
        """Distance of a fit; None where no readings stand behind what is known."""
        known, pattern = fit.parameters.known, fit.parameters.pattern
        if known is None or not known.readings:
            return None
        prior, count = fit.parameters.prior, len(pattern)
        # The pattern comes first, and the factor is lower triangular: this is its marginal.
        away = prior.whiten(fit.vector)[:count]
        single = ((fit.vector - prior.centre) / prior.width)[:count]
        names = (coordinate.name for coordinate in pattern.coordinates)
        return PatternShift(
            float(np.linalg.norm(away)), dict(zip(names, map(float, single), strict=True))
        )

    @property
    def usual(self) -> float:
        """Distance that 95 % of patterns stay below if jobs differ as assumed.

        Of fits more do, as these are drawn toward what was known.
        """
        return float(np.sqrt(chdtri(len(self.by_coordinate), 1.0 - 0.95)))

    @property
    def is_alarming(self) -> bool:
        """Whether one job in a thousand differs as much, if they differ as assumed."""
        return bool(self.distance > np.sqrt(chdtri(len(self.by_coordinate), 1.0 - 0.999)))

    def __str__(self) -> str:
        name, most = max(self.by_coordinate.items(), key=lambda item: abs(item[1]))
        return (
            f'{self.distance:.1f} standard deviations from the calibration, most in {name} '
            f'({most:+.1f}); at least 95 % of jobs stay below {self.usual:.1f}'
        )

    @property
    def warning(self) -> str:
        """What to do about one that is alarming."""
        return (
            f'The pattern moved {self}: far more than jobs differ. Check that bell, settings and '
            'part frame are those of the calibration, or calibrate anew.'
        )

    def to_dict(self) -> dict[str, object]:
        """The entry ``pattern_shift`` in ``diagnosis.json``."""
        return {
            'standard_deviations': self.distance,
            'usual': self.usual,
            'by_coordinate': self.by_coordinate,
        }


def with_brushes_of(campaign: Campaign, model: DepositionModel) -> DepositionModel:
    """A model with the brushes that painted a campaign's parts, and no others.

    One pattern is the first guess of all brushes, with the set-points of the recordings.

    Raises:
        ModelError: the model has brushes, but not one of these.
        ReadingsError: some recordings name their brush and others do not.
    """
    numbers = campaign.brushes
    if model.brushes or len(numbers) <= 1:
        return model.of_numbers(numbers)
    if ONLY_BRUSH in numbers:
        silent = next(e.name for e in campaign.experiments if ONLY_BRUSH in e.brushes)
        raise ReadingsError(
            f"experiment '{silent}' names no brush, others name {listed(numbers - {ONLY_BRUSH})}: "
            'give it `brush: NUMBER` in the campaign'
        )
    brushes = tuple(
        Brush(number=n, planar=model.planar, **_set_points(campaign, n)) for n in numbers
    )
    return DepositionModel(brushes=brushes, projection=model.projection, effects=model.effects)


def _set_points(campaign: Campaign, number: int) -> dict[str, float]:
    """Medians over the recordings with this brush alone."""
    found = {}
    # What recordings hold of the process beside the flow, which is relative to the brush's.
    for name in ('shaping_air_l_per_min', 'bell_speed_rpm', 'voltage_kv'):
        recorded = [
            abs(e.settings[name])
            for e in campaign.experiments
            if e.brushes == {number} and e.settings.get(name)
        ]
        if recorded:
            found[name] = float(np.median(recorded))
    return found
