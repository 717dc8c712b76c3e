"""What a law of an effect sees of one ray, inside the hot loop."""

from typing import NamedTuple


class Ray(NamedTuple):
    """One straight ray from the emission point to a surface point, inside the kernel.

    Attributes:
        x_m, y_m: where it pierces the model plane, tool axes [m].
        standoff_ratio: distance along the bell's axis over Omega [1].
        cos_incidence: cosine of the angle to the surface normal, above 0 [1].
        speed_m_per_s: speed of the atomizer [m/s].
    """

    x_m: float
    y_m: float
    standoff_ratio: float
    cos_incidence: float
    speed_m_per_s: float
