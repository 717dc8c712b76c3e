"""The part's own axes: which way is across and which way is down on it, seen from the gun."""

import numpy as np

# A part that leans less than this from the horizontal lies flat: its lean says not which side is
# the right one [rad].
FLAT_RAD = np.radians(3.0)


def across_axis(outward: np.ndarray, down: np.ndarray) -> np.ndarray:
    """(3,) horizontal unit vector along the part, to the right as the gun sees it.

    On a part that lies flat it is the mesh's x axis, or y where x is vertical.

    Args:
        outward: (3,) mean outward unit normal of the part.
        down: (3,) unit vector of gravity.
    """
    level = np.cross(outward, down)
    length = np.linalg.norm(level)
    if length > FLAT_RAD:
        return level / length
    axis = np.eye(3)[0] if abs(down[0]) < 0.9 else np.eye(3)[1]
    level = axis - (axis @ down) * down
    return level / np.linalg.norm(level)


def downhill_axis(outward: np.ndarray, down: np.ndarray) -> np.ndarray:
    """(3,) unit vector down along the part, at right angles to ``across_axis`` and ``outward``."""
    along = np.cross(across_axis(outward, down), outward)
    return along / np.linalg.norm(along)
