"""How the gun ran over the parts of a campaign, and whether it painted them."""

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ReadingsError
from paint_deposition.film.integrator import NO_PAINT_UM
from paint_deposition.film.spray_geometry import SprayGeometry, spray_geometry
from paint_deposition.readings.campaign import Campaign


def geometry_by_experiment(campaign: Campaign, model: DepositionModel) -> dict[str, SprayGeometry]:
    """How the gun ran over each part, by the name of its experiment."""
    return {
        one.name: spray_geometry(one.surface, one.path, model, one.frame_id)
        for one in campaign.experiments
    }


def require_paint(campaign: Campaign, model: DepositionModel, film_um: np.ndarray) -> None:
    """Refuse an experiment in which no paint lands at any measured point.

    Args:
        campaign: painted parts with readings.
        model: that predicts the film.
        film_um: (P,) its film at the points [um].

    Raises:
        ReadingsError: one line with the likely cause.
    """
    for number, one in enumerate(campaign.experiments):
        if film_um[campaign.experiment_of == number].max() >= NO_PAINT_UM:
            continue
        found = spray_geometry(one.surface, one.path, model, one.frame_id)
        cause = found.warnings[0] if found.warnings else found.sentence
        raise ReadingsError(
            f"experiment '{one.name}': no paint lands where it was measured: {cause}"
        )
