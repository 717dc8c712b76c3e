"""What a fit has learned, in the form in which the next one takes it as its prior."""

import numpy as np
from scipy.linalg import block_diag

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.inference.fitting.estimates import scaled_covariance
from paint_deposition.inference.fitting.least_squares import Fit
from paint_deposition.inference.fitting.pattern_vector import PatternVector
from paint_deposition.inference.posterior import Posterior
from paint_deposition.inference.readings.campaign import Campaign

# Settings that differ by a larger share than this are others.
OTHER_SETTING = 0.05


def posterior_of(fit: Fit, campaign: Campaign, shifts: np.ndarray | None = None) -> Posterior:
    """The posterior of a fit to a campaign, widened as ``scaled_covariance`` is."""
    parameters = fit.parameters
    names, scale = parameters.coordinates, parameters.scale
    mean = parameters.offset + scale * fit.vector
    covariance = scaled_covariance(fit.marginal, shifts) * np.outer(scale, scale)
    rows = 0.5 * (covariance + covariance.T)
    known = parameters.known.readings if parameters.known else ()
    return Posterior(
        mean=dict(zip(names, map(float, mean), strict=True)),
        covariance=dict(zip(names, rows.tolist(), strict=True)),
        readings=(*known, *fingerprints(campaign)),
        process=campaign.settings,
    )


def of_brushes(
    known: Posterior | None, given: DepositionModel, start: DepositionModel
) -> Posterior | None:
    """What is known of the brushes that painted a campaign.

    Where nothing was calibrated, a model with several brushes still tells how they differ: their
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
    covariance = kept.in_common(width) + np.diag(deviations**2)
    names = [c.name for c in kept.coordinates]
    return Posterior(
        mean=dict(zip(names, map(float, kept.encode(start.patterns)), strict=True)),
        covariance=dict(zip(names, covariance.tolist(), strict=True)),
    )


def _select(known: Posterior, whole: PatternVector, kept: PatternVector) -> Posterior:
    """The posterior of some brushes out of that of all; what else it tells stays."""
    if whole.brushes == kept.brushes:
        return known
    names = [c.name for c in whole.coordinates]
    of_effects = [name for name in known.names if name not in names]
    entries, slope = kept.out_of(whole, np.array([known.mean[name] for name in names]))
    mean = np.concatenate([entries, [known.mean[name] for name in of_effects]])
    linear = block_diag(slope, np.eye(len(of_effects)))
    order = [known.names.index(name) for name in (*names, *of_effects)]
    matrix = linear @ known.matrix[np.ix_(order, order)] @ linear.T
    new = [*(c.name for c in kept.coordinates), *of_effects]
    return known.model_copy(update={
        'mean': dict(zip(new, mean.tolist(), strict=True)),
        'covariance': dict(zip(new, matrix.tolist(), strict=True)),
    })  # fmt: skip


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
            f'What the model file knows of the pattern rests on the readings of '
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
