"""Eq. (2) of Conner et al. (IROS 2002): the planar model projected onto any surface.

    flux(s) = (Omega / l)^2 <e, n> / <e, z>^3 d(q),    q = Omega (s - p) / <s - p, z>

with the emission point p, the unit vector e from it to the surface point s at a distance l, the
bell's axis z and the surface normal n, turned against e. The film is summed by the compiled loop
of ``kernel/eq2_flux.py``; here the formula stands in NumPy, to be read beside the paper.
"""

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
    """(V,) flux of one pose on surface points [um/s], 0 where they face away or lie behind.

    Args:
        positions_m, normals: (V, 3) surface points [m], outward unit normals.
        tcp_m: (3,) tool centre point (bell cup centre) [m].
        rotation: (3, 3) tool axes as columns; z points from the bell to the surface.
    """
    omega = projection.model_plane_m
    to_surface = positions_m - (tcp_m - projection.emission_offset_m * rotation[:, 2])
    length = np.linalg.norm(to_surface, axis=1)
    x, y, z = (to_surface @ rotation).T
    cos_incidence = -np.einsum('ij,ij->i', to_surface, normals) / np.maximum(length, NEAREST_M)
    lit = (z > projection.nearest_m) & (cos_incidence > 0.0)
    z = np.where(lit, z, 1.0)
    magnification = (omega / length) ** 2 * cos_incidence / (z / length) ** 3
    return np.where(lit, magnification * planar.flux_um_per_s(omega * x / z, omega * y / z), 0.0)
