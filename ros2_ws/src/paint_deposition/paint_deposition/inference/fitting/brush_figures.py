"""What a calibration says of its brushes."""

import math
from collections.abc import Sequence
from typing import Any

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.paint_used import efficiency
from paint_deposition.inference.fitting.estimates import Estimate
from paint_deposition.model.brush import BrushLaw


def brush_figures(model: DepositionModel, parameters: Sequence[Estimate]) -> dict[str, Any] | None:
    """Set-points and transfer efficiency of each brush, and the law between them.

    None without brushes. The efficiency is that on a part which catches everything.

    Args:
        model: calibrated. parameters: its own, with uncertainties.
    """
    if not model.brushes:
        return None
    several = len(model.brushes) > 1
    by_name = {value.name: value for value in parameters}
    found: dict[str, Any] = {}
    for brush in model.brushes:
        share = efficiency(brush)
        name = f'brush_{brush.number}.K1_cm3_per_s' if several else 'K1_cm3_per_s'
        relative = by_name[name].sigma / by_name[name].value
        known = not math.isnan(share)
        found[str(brush.number)] = {
            **brush.set_points.model_dump(exclude_none=True),
            'transfer_efficiency': share if known else None,
            'transfer_efficiency_sigma': share * relative if known else None,
        }
    law = BrushLaw(model.brushes).exponents() if several else {}
    exponents = {
        of: {name: {'value': value, 'sigma': sigma} for name, (value, sigma) in each.items()}
        for of, each in law.items()
    }
    return {'by_number': found, 'exponents': exponents}
