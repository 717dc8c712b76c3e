"""Two brushes of one atomizer, and motions that switch between them."""

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.model.eq1_pattern import Brush, PlanarPattern

# All of a narrow pattern lands within 0.3 m of the axis at the standoffs used in tests.
NARROW = PlanarPattern(K1_cm3_per_s=1.3, r_m=0.05, sigma1_m=0.03, sigma2_m=0.04)
WIDE = PlanarPattern(K1_cm3_per_s=2.1, K2=0.4, phi_rad=-1.0, r_m=0.09, sigma1_m=0.05)
SET_POINTS = {
    1: {'flow_cm3_per_min': 200.0, 'bell_speed_rpm': 50_000.0, 'solids': 0.45},
    2: {'flow_cm3_per_min': 350.0, 'bell_speed_rpm': 30_000.0, 'solids': 0.45},
}


def two_brushes(**rest) -> DepositionModel:
    """A narrow brush 1 and a wide brush 2."""
    patterns = {1: NARROW, 2: WIDE}
    return DepositionModel(
        brushes=(Brush(number=n, planar=p, **SET_POINTS[n]) for n, p in patterns.items()), **rest
    )


def switched(stamps_ns, *changes: tuple[float, int]) -> dict[str, np.ndarray]:
    """A trigger that takes flow and brush at each of these stamps."""
    flow, brush = zip(*changes, strict=True)
    return {
        'trigger_stamps_ns': np.asarray(stamps_ns),
        'trigger_flow': np.array(flow, dtype=float),
        'trigger_brush': np.array(brush, dtype=np.int64),
    }
