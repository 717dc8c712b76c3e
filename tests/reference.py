"""The film by eqs. (1) and (2) in NumPy, with the laws of effects evaluated ray by ray."""

import numpy as np

from paint_deposition.effects.base import Ray
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.points import SurfacePoints


def reference_film_um(
    points: SurfacePoints, path: SprayPath, model: DepositionModel
) -> np.ndarray:
    """(V,) film [um] of a path as it is, without shadows, effects on path or on film."""
    film = np.zeros(len(points))
    for row in np.flatnonzero(path.flow * path.dwell_s):
        film += path.flow[row] * path.dwell_s[row] * _flux_um_per_s(points, path, row, model)
    return film


def _flux_um_per_s(
    points: SurfacePoints, path: SprayPath, row: int, model: DepositionModel
) -> np.ndarray:
    omega = model.projection.model_plane_m
    rotation = path.rotation[row]
    emission_point = path.position_m[row] - model.projection.emission_offset_m * rotation[:, 2]
    to_point = points.positions_m - emission_point
    x, y, z = (to_point @ rotation).T
    length = np.linalg.norm(to_point, axis=1)
    cos_incidence = -np.einsum('ij,ij->i', to_point, points.normals) / length
    lit = (z > max(model.projection.emission_offset_m, 1e-3)) & (cos_incidence > 0.0)
    flux = np.zeros(len(points))
    for point in np.flatnonzero(lit):
        ray = Ray(
            omega * x[point] / z[point] - path.pattern_shift_m[row, 0],
            omega * y[point] / z[point] - path.pattern_shift_m[row, 1],
            z[point] / omega,
            cos_incidence[point],
            path.speed_m_per_s[row],
        )
        factor, scale = 1.0, 1.0
        for effect in model.effects:
            if effect.flux_factor is not None:
                factor *= effect.flux_factor(ray, *effect.values())
            if effect.pattern_scale is not None:
                scale *= effect.pattern_scale(ray, *effect.values())
        cos_axis = z[point] / length[point]
        magnification = omega**2 * cos_incidence[point] / (length[point] ** 2 * cos_axis**3)
        planar = model.planar.flux_um_per_s(scale * ray.x_m, scale * ray.y_m)
        flux[point] = factor * scale**2 * magnification * planar
    return flux
