"""Eq. (2) of Conner et al. (IROS 2002): the planar model projected onto any surface.

    D(s, p) = (Omega / L)^2 <e, n> / <e, z>^3 d(q),    q = Omega (s - o) / <s - o, z>

with the pose p, its emission point o, the unit vector e from it to the surface point s at a
distance L, the bell's axis z and the surface normal n, which points into the part.
``kernel/eq2_flux.py`` sums it.
"""

from pydantic import BaseModel, ConfigDict, Field

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

    def magnification(self, standoff_m: float) -> float:
        """How many times wider the pattern is at a standoff [m] than on the model plane."""
        return (standoff_m + self.emission_offset_m) / self.model_plane_m

    @property
    def nearest_m(self) -> float:
        """Distance from the emission point along the bell's axis up to which no paint lands [m].

        What lies behind the bell gets none, nor does what touches the emission point.
        """
        return max(self.emission_offset_m, NEAREST_M)
