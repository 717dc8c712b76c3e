"""The model that a campaign of several brushes starts from."""

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ReadingsError
from paint_deposition.inference.readings.campaign import Campaign
from paint_deposition.model.brush import Brush, SetPoints, listed
from paint_deposition.motion.trigger import ONLY_BRUSH

# What recordings tell of the process beside the flow, which they tell relative to the brush's.
RECORDED = ('shaping_air_l_per_min', 'bell_speed_rpm', 'voltage_kv')


def with_brushes_of(campaign: Campaign, model: DepositionModel) -> DepositionModel:
    """A model with the brushes that painted a campaign's parts, and no others.

    One pattern is the first guess of all brushes, with the set-points that the recordings tell.

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
    return DepositionModel.of_brushes(
        (
            Brush(number=n, planar=model.planar, **_set_points(campaign, n).model_dump())
            for n in numbers
        ),
        projection=model.projection, effects=model.effects,
    )  # fmt: skip


def _set_points(campaign: Campaign, number: int) -> SetPoints:
    """Those that the recordings with this brush alone tell."""
    found = {}
    for name in RECORDED:
        told = [
            abs(e.settings[name])
            for e in campaign.experiments
            if e.brushes == {number} and e.settings.get(name)
        ]
        if told:
            found[name] = float(np.median(told))
    return SetPoints(**found)
