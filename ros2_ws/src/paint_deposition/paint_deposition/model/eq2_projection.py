"""Projection of the planar model onto any surface, eq. (2) of Conner et al. (IROS 2002)."""

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from paint_deposition.model.eq1_pattern import PlanarPattern

# Eq. (2) has a pole at the emission point.
NEAREST_M = 1e-3


class Projection(BaseModel):
    """Where the virtual emission point and the model plane lie."""

    model_config = ConfigDict(frozen=True, extra='forbid', allow_inf_nan=False)

    model_plane_m: float = Field(
        0.30, gt=0.0, le=5.0, description='Omega, emission point to model plane [m]'
    )
    emission_offset_m: float = Field(
        0.05, ge=-1.0, le=5.0, description='emission point behind the TCP, along -z [m]'
    )

    @property
    def nominal_standoff_m(self) -> float:
        """Distance of the TCP from the part at which the part lies on the model plane [m]."""
        return self.model_plane_m - self.emission_offset_m

    @property
    def nearest_m(self) -> float:
        """Distance from the emission point along the bell's axis up to which no paint lands [m].

        What lies behind the bell gets none, nor does what touches the emission point.
        """
        return max(self.emission_offset_m, NEAREST_M)


def flux_um_per_s(
    planar: PlanarPattern,
    projection: Projection,
    positions_m: np.ndarray,
    normals: np.ndarray,
    tcp_m: np.ndarray,
    rotation: np.ndarray,
) -> np.ndarray:
    """Eq. (2): deposition flux on surface elements for one atomizer pose.

    The double-precision reference that the compiled kernel is checked against. With the outward
    unit normal n, the paper's <e, n> of a surface that faces the bell is -<e, n_outward>.

    Args:
        planar: the planar model d(q) of eq. (1).
        projection: Omega and the emission point.
        positions_m: (V, 3) surface points s [m].
        normals: (V, 3) outward unit normals.
        tcp_m: (3,) tool centre point (bell cup centre) [m].
        rotation: (3, 3) tool axes as columns; z points from the bell to the surface.

    Returns:
        (V,) flux [um/s]; zero where the surface faces away or lies behind the bell or behind the
        emission point.
    """
    z = rotation[:, 2]
    emission_point = tcp_m - projection.emission_offset_m * z
    to_surface = positions_m - emission_point
    along_z = to_surface @ z
    in_front = along_z > projection.nearest_m
    distance = np.linalg.norm(to_surface, axis=1)
    e = to_surface / np.where(distance > 0.0, distance, 1.0)[:, np.newaxis]
    cos_incidence = -np.einsum('ij,ij->i', e, normals)
    lit = in_front & (cos_incidence > 0.0)

    omega = projection.model_plane_m
    scale = omega / np.where(lit, along_z, 1.0)
    flux = planar.flux_um_per_s(
        scale * (to_surface @ rotation[:, 0]), scale * (to_surface @ rotation[:, 1])
    )
    cos_axis = np.where(lit, e @ z, 1.0)
    magnification = omega**2 * cos_incidence / (np.where(lit, distance, 1.0) ** 2 * cos_axis**3)
    return np.where(lit, magnification * flux, 0.0)
