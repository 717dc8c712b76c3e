"""A step of a planned motion: straight to a pose, with the gun on or off on the way."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class PlannedMove:
    """A straight move to a pose of the TCP, in the part's frame.

    Attributes:
        position_m: (3,) TCP at the end of the move [m].
        quaternion_xyzw: (4,) orientation of the tool there, scalar last.
        speed_m_per_s: speed of the TCP on the way [m/s].
        spraying: whether the gun is on while moving there.
    """

    position_m: np.ndarray
    quaternion_xyzw: np.ndarray
    speed_m_per_s: float
    spraying: bool
