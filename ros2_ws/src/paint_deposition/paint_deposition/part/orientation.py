"""Which way a part faces and which way it hangs, for open sheets and closed bodies."""

import numpy as np

# Mean normals shorter than this share cancel, as on a closed body: they name no side.
CANCELLED = 0.1
# Parts whose mean normal is longer have their surface on one side, give or take a flange.
ONE_SIDED = 0.5
# A part whose mean normal leans less than this from the horizontal plane stands.
STANDING_COSINE = 0.7


def outward_side(
    normals: np.ndarray,
    areas_m2: np.ndarray | None,
    down: np.ndarray,
    gun_side: np.ndarray | None = None,
) -> np.ndarray:
    """(3,) unit mean of the (V, 3) normals, weighted by (V,) areas, on the painted side.

    On a closed body it is the mean over the surface that faces the gun, found from roughly where
    the gun is (``gun_side``, any length): on a part that has sides any motion before one gives the
    same, to the last bit. Where the normals cancel and no gun is known, it is -y, or z.
    """
    mean = mean_normal(normals, areas_m2)
    length = np.linalg.norm(mean)
    if gun_side is not None and len(normals) and length < ONE_SIDED:
        # From the nearest of 26 directions, until the mean settles.
        direction = np.rint(1.2 * gun_side / np.abs(gun_side).max())
        direction /= np.linalg.norm(direction)
        chosen = None
        for _ in range(32):
            # Surface of the side that the gun paints leans less than this from the side's mean.
            about = normals @ direction > 0.5
            if not about.any() or (chosen is not None and np.array_equal(about, chosen)):
                break
            chosen = about
            direction = mean_normal(normals[about], None if areas_m2 is None else areas_m2[about])
            direction /= np.linalg.norm(direction)
        return direction
    if length > CANCELLED:
        return mean / length
    return np.array([0.0, -1.0, 0.0]) if abs(down[1]) < 0.9 else np.array([0.0, 0.0, 1.0])


def mean_normal(normals: np.ndarray, areas_m2: np.ndarray | None) -> np.ndarray:
    """(3,) mean of the (V, 3) normals, of length 1 on a plane and 0 on a closed body."""
    return np.average(normals, axis=0, weights=areas_m2) if len(normals) else np.zeros(3)


def gravity(
    vertices_m: np.ndarray, normals: np.ndarray, areas_m2: np.ndarray
) -> tuple[np.ndarray, str]:
    """Guess which way is down, (3,), and a note for the user where it is a guess, else ''.

    Down is -z. A part that lies in x-y does so in the booth, a hood or a roof, if it is away from
    the plane z = 0. In that plane it was drawn flat, and hangs: down is -y.
    """
    mean = mean_normal(normals, areas_m2)
    length = np.linalg.norm(mean)
    lies = abs(mean[2]) >= STANDING_COSINE * length
    if length <= CANCELLED:  # a closed body lies as a plate, not as a block
        spread = np.einsum('v,vi,vj->ij', areas_m2, normals, normals) / areas_m2.sum()
        shares, directions = np.linalg.eigh(spread)
        # Share of a closed body's surface along one direction that makes it a plate.
        lies = shares[-1] > 0.7 and abs(directions[2, -1]) >= STANDING_COSINE
    if not lies:
        return np.array([0.0, 0.0, -1.0]), ''
    # A part drawn flat is no further from that plane [m].
    if vertices_m[:, 2].min() - 0.1 <= 0.0 <= vertices_m[:, 2].max() + 0.1:
        return np.array([0.0, -1.0, 0.0]), (
            'the part lies in x-y at z = 0, as if drawn flat: gravity is taken along -y of the '
            'mesh; if it lies so in the booth, as a hood or a roof does, give down 0 0 -1'
        )
    return np.array([0.0, 0.0, -1.0]), (
        'the part lies, as a hood or a roof does: gravity is taken along -z of the mesh; if it '
        'hangs while it is painted, give down'
    )


def across_axis(outward: np.ndarray, down: np.ndarray) -> np.ndarray:
    """(3,) horizontal unit vector along the part, to the right as the gun sees it.

    On a part that lies flat it is the mesh's x axis, or y where x is vertical.
    """
    level = np.cross(outward, down)
    length = np.linalg.norm(level)
    # A part that leans less than this from the horizontal lies flat: its lean says not which side
    # is the right one [rad].
    if length > np.radians(3.0):
        return level / length
    axis = np.eye(3)[0] if abs(down[0]) < 0.9 else np.eye(3)[1]
    level = axis - (axis @ down) * down
    return level / np.linalg.norm(level)


def downhill_axis(outward: np.ndarray, down: np.ndarray) -> np.ndarray:
    """(3,) unit vector down along the part, at right angles to ``across_axis`` and ``outward``."""
    along = np.cross(across_axis(outward, down), outward)
    return along / np.linalg.norm(along)
