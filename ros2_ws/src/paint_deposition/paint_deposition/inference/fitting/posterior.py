"""The posterior of a fit: the prior of the next job, and models drawn from it."""

import numpy as np
from scipy.linalg import block_diag

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.learned.curves import LearnedCurve
from paint_deposition.errors import ModelError
from paint_deposition.inference.fitting.estimates import scaled_covariance
from paint_deposition.inference.fitting.least_squares import Fit
from paint_deposition.inference.fitting.parameters import FreeParameters
from paint_deposition.inference.fitting.pattern_vector import PatternVector
from paint_deposition.inference.posterior import Posterior
from paint_deposition.inference.readings.campaign import Campaign

# Settings that differ by a larger share than this are others.
OTHER_SETTING = 0.05


def posterior_of(fit: Fit, campaign: Campaign, shifts: np.ndarray | None = None) -> Posterior:
    """The posterior of a fit to a campaign, widened as ``scaled_covariance`` is."""
    parameters = fit.parameters
    scale = parameters.scale
    covariance = scaled_covariance(fit.marginal, shifts) * np.outer(scale, scale)
    known = parameters.known.readings if parameters.known else ()
    return Posterior.of(
        parameters.coordinates, parameters.offset + scale * fit.vector,
        0.5 * (covariance + covariance.T), readings=(*known, *fingerprints(campaign)),
        process=campaign.settings,
    )  # fmt: skip


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
    return Posterior.of(new, mean, matrix, readings=known.readings, process=known.process)


def usable(
    known: Posterior | None, campaign: Campaign
) -> tuple[Posterior | None, tuple[str, ...]]:
    """What may serve as the prior for a campaign, and a remark where it may not.

    No reading counts twice: a posterior that rests on readings of the campaign is none.
    """
    if known is None:
        return None, ()
    behind = set(known.readings)
    twice = [e.name for e in campaign.experiments if e.taken.fingerprint in behind]
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
        if abs(now - then) > OTHER_SETTING * abs(then)
    )


def fingerprints(campaign: Campaign) -> tuple[str, ...]:
    """Of the readings of each experiment."""
    return tuple(experiment.taken.fingerprint for experiment in campaign.experiments)


# Values of a learned curve so many knots apart have nearly independent errors.
KNOTS_TOGETHER = 2.0
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
    apart = np.subtract.outer(knots, knots) / KNOTS_TOGETHER
    covariance = np.exp(-0.5 * apart**2) * np.outer(effect.sd, effect.sd)
    learned = rng.multivariate_normal(effect.learned, covariance, method='eigh')
    return effect.model_copy(update={'learned': tuple(learned.tolist())})
