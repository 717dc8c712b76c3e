"""How the gun ran over the parts of a campaign, and whether it painted them."""

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ModelError, ReadingsError
from paint_deposition.film.integrator import NO_PAINT_UM, FilmIntegrator
from paint_deposition.film.spray_geometry import SprayGeometry, spray_geometry
from paint_deposition.inference.readings.campaign import Campaign


def geometry_by_experiment(campaign: Campaign, model: DepositionModel) -> dict[str, SprayGeometry]:
    """How the gun ran over each part, by the name of its experiment."""
    return {
        one.name: spray_geometry(one.surface, one.path, model, one.frame_id)
        for one in campaign.experiments
    }


def require_paint(campaign: Campaign, model: DepositionModel) -> None:
    """Refuse an experiment in which no paint lands at any measured point.

    Args:
        campaign: painted parts with readings.
        model: its pattern and projection count, its effects do not.

    Raises:
        ReadingsError: one line with the likely cause.
        ModelError: a brush that painted it is not in the model.
    """
    plain = model.model_copy(update={'effects': ()})
    for one in campaign.experiments:
        try:
            plain.require_brushes(one.brushes)
        except ModelError as error:
            raise ModelError(f"experiment '{one.name}': {error}") from None
        painted = FilmIntegrator(one.measured_points, plain, 'double', parallel=False)
        painted.add(one.path)
        if painted.raw_um.max() >= NO_PAINT_UM:
            continue
        cause = 'the gun never sprays'
        if np.any(one.path.flow > 0.0):
            found = spray_geometry(one.surface, one.path, plain, one.frame_id)
            cause = found.warnings[0] if found.warnings else found.sentence
        raise ReadingsError(
            f"experiment '{one.name}': no paint lands where it was measured: {cause}"
        )
