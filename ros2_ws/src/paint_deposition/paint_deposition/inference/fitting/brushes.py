"""Brushes of a campaign: the model to start from, and what a calibration says of them."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ReadingsError
from paint_deposition.film.paint_used import efficiency
from paint_deposition.inference.fitting.estimates import Estimate
from paint_deposition.inference.readings.campaign import Campaign
from paint_deposition.model.eq1_pattern import Brush, SetPoints, listed
from paint_deposition.motion.trajectory import ONLY_BRUSH

# What recordings hold of the process beside the flow, which is relative to the brush's.
RECORDED = ('shaping_air_l_per_min', 'bell_speed_rpm', 'voltage_kv')


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
    return DepositionModel.of_brushes(
        (
            Brush(number=n, planar=model.planar, **_set_points(campaign, n).model_dump())
            for n in numbers
        ),
        projection=model.projection, effects=model.effects,
    )  # fmt: skip


def _set_points(campaign: Campaign, number: int) -> SetPoints:
    """Medians over the recordings with this brush alone."""
    found = {}
    for name in RECORDED:
        recorded = [
            abs(e.settings[name])
            for e in campaign.experiments
            if e.brushes == {number} and e.settings.get(name)
        ]
        if recorded:
            found[name] = float(np.median(recorded))
    return SetPoints(**found)


def brush_figures(model: DepositionModel, parameters: Sequence[Estimate]) -> dict[str, Any] | None:
    """Set-points and transfer efficiency of each brush.

    None without brushes. The efficiency is that on a part which catches everything.
    """
    if not model.brushes:
        return None
    several = len(model.brushes) > 1
    relative = {value.name: value.sigma / value.value for value in parameters if value.value}
    by_number: dict[str, Any] = {}
    for brush in model.brushes:
        share = efficiency(brush)
        name = f'brush_{brush.number}.K1_cm3_per_s' if several else 'K1_cm3_per_s'
        known = not math.isnan(share)
        by_number[str(brush.number)] = {
            **brush.set_points.model_dump(exclude_none=True),
            'transfer_efficiency': share if known else None,
            'transfer_efficiency_sigma': share * relative[name] if known else None,
        }
    return {'by_number': by_number}
