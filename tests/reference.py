"""The film by eqs. (1) and (2) in NumPy, with the laws of effects evaluated ray by ray."""

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.kernel.eq2_flux import Ray
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
    omega, offset_m = model.projection.model_plane_m, model.projection.emission_offset_m
    rotation = path.rotation[row]
    to_point = points.positions_m - (path.position_m[row] - offset_m * rotation[:, 2])
    length = np.linalg.norm(to_point, axis=1)
    cos_incidence = -np.einsum('ij,ij->i', to_point, points.normals) / length
    lit = np.flatnonzero((to_point @ rotation[:, 2] > max(offset_m, 1e-3)) & (cos_incidence > 0.0))
    x, y, z = (to_point[lit] @ rotation).T
    shift_x, shift_y = path.pattern_shift_m[row]
    rays = np.stack([
        omega * x / z - shift_x, omega * y / z - shift_y, z / omega, cos_incidence[lit],
        np.full(len(lit), path.speed_m_per_s[row]),
    ], axis=1)  # fmt: skip
    factor, scale = np.ones((2, len(lit)))
    for effect in model.effects:
        for law, total in ((effect.flux_factor, factor), (effect.pattern_scale, scale)):
            if law is not None:
                total *= [law(Ray(*ray), *effect.values()) for ray in rays]
    magnification = omega**2 * cos_incidence[lit] / (length[lit] ** 2 * (z / length[lit]) ** 3)
    planar = model.planar.flux_um_per_s(scale * rays[:, 0], scale * rays[:, 1])
    flux = np.zeros(len(points))
    flux[lit] = factor * scale**2 * magnification * planar
    return flux
