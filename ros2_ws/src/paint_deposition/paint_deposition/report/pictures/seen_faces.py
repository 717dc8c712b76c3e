"""Which triangle of a part each pixel of a picture shows, by a depth buffer."""

import numpy as np
from numba import njit

# Pixels on a common edge belong to both triangles, whatever was rounded.
ON_THE_EDGE = -1e-9
# The first of such triangles has the pixel; the next counts as one between pixels.
LEVEL_M = 1e-9


@njit(cache=True, nogil=True, error_model='numpy')
def seen_faces(flat, toward, faces, low, step, height, width):
    """Look at a part along parallel rays; triangles are seen from their outward side only.

    Args:
        flat: (V, 2) places of the vertices in the picture [m]. toward: (V,) to the viewer [m].
        faces: (F, 3), right-handed about the outward normal.
        low: (2,) corner of the lowest left pixel [m]. step: (2,) width and height of a pixel [m].
        height, width: number of pixels.

    Returns:
        (height, width) nearest triangle, -1 for none; (height, width, 3) weights of its corners,
        NaN for none; (F,) bool, triangles that are seen, those between pixels among them.
    """
    nearest = np.full((height, width), -1, dtype=np.int64)
    weights = np.full((height, width, 3), np.nan)
    depth = np.full((height, width), -np.inf)
    between = np.zeros(len(faces), dtype=np.bool_)
    for f in range(len(faces)):
        i, j, k = faces[f]
        ax, ay = flat[i, 0] - flat[k, 0], flat[i, 1] - flat[k, 1]
        bx, by = flat[j, 0] - flat[k, 0], flat[j, 1] - flat[k, 1]
        area = ax * by - ay * bx
        if area <= 0.0:
            continue
        between[f] = True
        left, right = min(0.0, ax, bx) + flat[k, 0], max(0.0, ax, bx) + flat[k, 0]
        below, above = min(0.0, ay, by) + flat[k, 1], max(0.0, ay, by) + flat[k, 1]
        for row in range(
            max(0, int(np.ceil((below - low[1]) / step[1] - 0.5))),
            min(height - 1, int(np.floor((above - low[1]) / step[1] - 0.5))) + 1,
        ):
            y = low[1] + (row + 0.5) * step[1] - flat[k, 1]
            for column in range(
                max(0, int(np.ceil((left - low[0]) / step[0] - 0.5))),
                min(width - 1, int(np.floor((right - low[0]) / step[0] - 0.5))) + 1,
            ):
                x = low[0] + (column + 0.5) * step[0] - flat[k, 0]
                one, other = (x * by - y * bx) / area, (ax * y - ay * x) / area
                third = 1.0 - one - other
                if min(one, other, third) < ON_THE_EDGE:
                    continue
                near = one * toward[i] + other * toward[j] + third * toward[k]
                if abs(near - depth[row, column]) <= LEVEL_M:
                    continue
                between[f] = False
                if near > depth[row, column]:
                    depth[row, column] = near
                    nearest[row, column] = f
                    weights[row, column, 0] = min(max(one, 0.0), 1.0)
                    weights[row, column, 1] = min(max(other, 0.0), 1.0)
                    weights[row, column, 2] = min(max(third, 0.0), 1.0)
    return nearest, weights, _seen(flat, toward, faces, low, step, nearest, depth, between)


@njit(cache=True, nogil=True, error_model='numpy')
def _seen(flat, toward, faces, low, step, nearest, depth, between):
    """Triangles in a pixel, and those between pixels that are not behind all pixels around."""
    height, width = nearest.shape
    seen = np.zeros(len(faces), dtype=np.bool_)
    for row in range(height):
        for column in range(width):
            if nearest[row, column] >= 0:
                seen[nearest[row, column]] = True
    for f in np.flatnonzero(between):
        i, j, k = faces[f]
        column = int(((flat[i, 0] + flat[j, 0] + flat[k, 0]) / 3.0 - low[0]) / step[0])
        row = int(((flat[i, 1] + flat[j, 1] + flat[k, 1]) / 3.0 - low[1]) / step[1])
        farthest = np.inf
        for r in range(max(0, row - 1), min(height, row + 2)):
            for c in range(max(0, column - 1), min(width, column + 2)):
                farthest = min(farthest, depth[r, c])
        here = (toward[i] + toward[j] + toward[k]) / 3.0
        seen[f] = here > farthest - max(step[0], step[1])
    return seen
