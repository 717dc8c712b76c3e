"""Residuals of single readings spread over the skin around them, for pictures."""

import numpy as np
from scipy.spatial import cKDTree

from paint_deposition.inference.comparison import Comparison
from paint_deposition.inference.study import Study
from paint_deposition.part.surface import Surface

SMALLEST_RADIUS_M, LARGEST_RADIUS_M = 0.025, 0.09
RADIUS_OVER_SPACING = 1.8
# Skin that faces another way is another side of the part.
SAME_SIDE_COSINE = 0.3


def spread_over_skin(
    surface: Surface, positions_m: np.ndarray, normals: np.ndarray, residual_um: np.ndarray
) -> np.ndarray:
    """Residual at each vertex (V,) [um], NaN where no reading is near.

    A mean of the readings within a radius, weighted by a smooth kernel: single readings are
    noisy, and what matters is where neighbours agree. The radius is somewhat more than the usual
    distance between neighbouring readings.

    Args:
        surface: the part.
        positions_m, normals: (P, 3) readings on its skin.
        residual_um: (P,) measured minus predicted.
    """
    radius = radius_of_readings_m(positions_m)
    tree = cKDTree(positions_m)
    near = tree.sparse_distance_matrix(
        cKDTree(surface.vertices_m), radius, output_type='coo_matrix'
    )
    point, vertex, distance = near.row, near.col, near.data
    facing = np.einsum('ni,ni->n', normals[point], surface.normals[vertex]) > SAME_SIDE_COSINE
    weight = np.where(facing, (1.0 - (distance / radius) ** 2) ** 3, 0.0)
    count = len(surface.vertices_m)
    total = np.bincount(vertex, weight, minlength=count)
    summed = np.bincount(vertex, weight * residual_um[point], minlength=count)
    return np.where(total > 0.0, summed / np.maximum(total, 1e-300), np.nan)


def radius_of_readings_m(positions_m: np.ndarray) -> float:
    """How far a reading speaks for the skin around it [m]."""
    if len(positions_m) < 2:
        return LARGEST_RADIUS_M
    nearest = cKDTree(positions_m).query(positions_m, k=2)[0][:, 1]
    usual = RADIUS_OVER_SPACING * float(np.median(nearest))
    return min(max(usual, SMALLEST_RADIUS_M), LARGEST_RADIUS_M)


def point_residuals_um(study: Study, comparison: Comparison) -> list[np.ndarray]:
    """Residuals averaged over repeats: for each experiment (P,) at its points [um]."""
    parts, start = [], 0
    for experiment in study.campaign.experiments:
        stop = start + len(experiment.readings)
        means = experiment.means
        residual = comparison.residual_um[start:stop]
        parts.append(np.bincount(means.owner, residual) / means.repeats)
        start = stop
    return parts
