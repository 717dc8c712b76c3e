"""Residuals at points interpolated over the surface around them, for pictures."""

import numpy as np
from scipy.sparse import csr_matrix, diags
from scipy.spatial import cKDTree

from paint_deposition.part.surface import Surface

SMALLEST_RADIUS_M, LARGEST_RADIUS_M = 0.025, 0.09
RADIUS_OVER_SPACING = 1.8
# Surface whose normal differs by more than 60 degrees is another side of the part.
SAME_SIDE_COSINE = 0.5


def interpolation_matrix(
    surface: Surface, positions_m: np.ndarray, normals: np.ndarray, radius_m: float | None = None
) -> csr_matrix:
    """Matrix (V, P) that interpolates values at points over the surface around them.

    Each vertex takes a mean of the points within the radius on its side of the part, weighted by
    a smooth kernel: single readings are noisy, and what matters is where neighbours agree. The
    row of a vertex without any is empty.

    Args:
        positions_m, normals: (P, 3) points on its surface.
        radius_m: default: ``radius_of_readings_m``.
    """
    radius_m = radius_m or radius_of_readings_m(positions_m)
    near = cKDTree(surface.vertices_m).sparse_distance_matrix(
        cKDTree(positions_m), radius_m, output_type='ndarray'
    )
    facing = np.einsum('ij,ij->i', surface.normals[near['i']], normals[near['j']])
    near = near[(facing > SAME_SIDE_COSINE) & (near['v'] < radius_m)]
    weight = (1.0 - (near['v'] / radius_m) ** 2) ** 3
    shape = (len(surface.vertices_m), len(positions_m))
    matrix = csr_matrix((weight, (near['i'], near['j'])), shape=shape)
    total = np.asarray(matrix.sum(axis=1)).ravel()
    return csr_matrix(diags(1.0 / np.where(total > 0.0, total, 1.0)) @ matrix)


def reached(matrix: csr_matrix) -> np.ndarray:
    """(V,) whether any point is within reach of the vertex."""
    return np.diff(matrix.indptr) > 0


def interpolate_over_surface(
    surface: Surface, positions_m: np.ndarray, normals: np.ndarray, residual_um: np.ndarray
) -> np.ndarray:
    """Residual at each vertex (V,) [um], NaN where no reading is near.

    Args:
        positions_m, normals: (P, 3) readings on its surface.
        residual_um: (P,) measured minus predicted.
    """
    matrix = interpolation_matrix(surface, positions_m, normals)
    return np.where(reached(matrix), matrix @ residual_um, np.nan)


def radius_of_readings_m(positions_m: np.ndarray) -> float:
    """Radius around a reading within which the surface is coloured by it [m].

    Somewhat more than the usual distance between neighbouring readings.
    """
    if len(positions_m) < 2:
        return LARGEST_RADIUS_M
    nearest = cKDTree(positions_m).query(positions_m, k=2)[0][:, 1]
    usual = RADIUS_OVER_SPACING * float(np.median(nearest))
    return min(max(usual, SMALLEST_RADIUS_M), LARGEST_RADIUS_M)
