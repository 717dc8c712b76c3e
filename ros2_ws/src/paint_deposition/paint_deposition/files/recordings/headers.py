"""Headers and set-points of messages, whoever decoded them."""

import math
from typing import Any

# Set-points of a state, in the order of those of a trajectory.
SET_POINTS = ('flow_cm3_per_min', 'shaping_air_l_per_min', 'bell_speed_rpm', 'voltage_kv')


def stamp_ns(header: Any) -> int:
    """A header's stamp in integer nanoseconds, which a float could not hold."""
    return header.stamp.sec * 1_000_000_000 + header.stamp.nanosec


def set_points_of(state: Any) -> tuple[float, ...]:
    """The set-points of a state, as those of a trajectory; 0 where it has none."""
    known = (abs(float(getattr(state, name, 0.0))) for name in SET_POINTS)
    return tuple(value if math.isfinite(value) else 0.0 for value in known)
