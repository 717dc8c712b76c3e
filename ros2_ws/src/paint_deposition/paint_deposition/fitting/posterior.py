"""What a fit has learned, in the form in which the next one takes it as its prior."""

import numpy as np

from paint_deposition.files.posterior import Posterior
from paint_deposition.fitting.estimates import scaled_covariance
from paint_deposition.fitting.least_squares import Fit
from paint_deposition.readings.campaign import Campaign

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
