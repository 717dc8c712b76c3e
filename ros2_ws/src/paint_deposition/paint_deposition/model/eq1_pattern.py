"""The planar deposition model, eq. (1) of Conner, Atkar, Rizzi and Choset (IROS 2002).

Its pattern, the brushes that have one each, and the coordinates in which its uncertainty is about
normal: logarithms of what is positive, and the asymmetry as K3 cos(phi) and K3 sin(phi), so that
phi is well-behaved when K3 vanishes.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict, Field


@dataclass(frozen=True)
class Coordinate:
    """A coordinate of the pattern, with what is known of it before any reading."""

    name: str  # as in the posterior of a model file
    # Mean and standard deviation of a weak prior.
    centre: float
    width: float
    # Bounds.
    low: float
    high: float
    between_jobs: float  # standard deviation between jobs of one bell at the same settings


# Weak priors: any bell's pattern lies well within two widths. They only keep finite what the
# readings do not determine. A ring that is more uneven than some tenths is no bell's: that is a
# draught, a tilt or an offset, for which an asymmetry without a limit would stand in.
#
# Between jobs: 4 % was found for the mean film of clearcoat on 40 panels painted alike; another
# batch of paint and another setting of the pump add to it. That the shape of the pattern varies
# by 6 %, with the viscosity and the wear of the cup, is an assumption, and wide on purpose: a
# value half of what jobs really differ takes many of them for a missing effect.
PATTERN = (
    Coordinate('log_K1', np.log(2.0), 2.0, np.log(1e-3), np.log(99.0), 0.10),
    Coordinate('K2', 0.3, 0.4, 0.0, 1.0, 0.06),
    Coordinate('K3_cos_phi', 0.0, 0.25, -0.99, 0.99, 0.06),
    Coordinate('K3_sin_phi', 0.0, 0.25, -0.99, 0.99, 0.06),
    Coordinate('r_m', 0.2, 0.15, 0.0, 0.99, 0.012),
    Coordinate('log_sigma1', np.log(0.09), 0.7, np.log(0.006), np.log(0.9), 0.06),
    Coordinate('log_sigma2', np.log(0.14), 0.7, np.log(0.006), np.log(0.9), 0.06),
)
# An effect's parameters differ between jobs by this share of their prior width; an assumption.
EFFECT_BETWEEN_JOBS = 0.6


class PlanarPattern(BaseModel):
    """Deposition flux of a stationary bell on the model plane: an asymmetric volcano.

    One offset Gaussian revolved around the origin (weight 1 - K2, made asymmetric by K3 and phi)
    and one centred Gaussian (weight K2). Both integrate to one over the plane, so K1 is the
    deposited solids volume rate. As 1 um m^2 = 1 cm^3, K1 times a density in 1/m^2 is in um/s.
    """

    model_config = ConfigDict(frozen=True, extra='forbid', allow_inf_nan=False)

    K1_cm3_per_s: float = Field(
        1.9, gt=0.0, le=100.0, description='K1, deposited solids volume rate [cm3/s]'
    )
    K2: float = Field(0.15, ge=0.0, le=1.0, description='K2, weight of the centred Gaussian [1]')
    K3: float = Field(0.2, ge=0.0, le=1.0, description='K3, asymmetry of the ring [1]')
    phi_rad: float = Field(
        0.6, ge=-2 * math.pi, le=2 * math.pi, description='phi, phase of the asymmetry [rad]'
    )
    r_m: float = Field(0.22, ge=0.0, le=1.0, description='r, offset radius of the ring [m]')
    sigma1_m: float = Field(
        0.09, ge=0.005, le=1.0, description='sigma_1, standard deviation of the ring [m]'
    )
    sigma2_m: float = Field(
        0.15, ge=0.005, le=1.0, description='sigma_2, of the centred Gaussian [m]'
    )

    @property
    def gamma_m2(self) -> float:
        """Normalisation of the revolved Gaussian [m^2], so that g1 integrates to one."""
        r, s = self.r_m, self.sigma1_m
        gaussian = 2.0 * s**2 * math.exp(-(r**2) / (2.0 * s**2))
        ring = r * s * math.sqrt(2.0 * math.pi) * math.erf(r / (math.sqrt(2.0) * s))
        return 2.0 * math.pi * (gaussian + ring)

    def f(self, x_m: ArrayLike, y_m: ArrayLike) -> np.ndarray:
        """Asymmetry 1 + K3 sin(atan2(y, x) - phi), dimensionless; arrays broadcast."""
        return 1.0 + self.K3 * np.sin(np.arctan2(y_m, x_m) - self.phi_rad)

    def g1(self, x_m: ArrayLike, y_m: ArrayLike) -> np.ndarray:
        """Revolved offset Gaussian [1/m^2]; arrays broadcast."""
        rho = np.hypot(x_m, y_m)
        two_variances = 2.0 * self.sigma1_m**2
        ring = np.exp(-((rho - self.r_m) ** 2) / two_variances)
        mirrored = np.exp(-((rho + self.r_m) ** 2) / two_variances)
        return (ring + mirrored) / self.gamma_m2

    def g2(self, x_m: ArrayLike, y_m: ArrayLike) -> np.ndarray:
        """Centred Gaussian [1/m^2]; arrays broadcast."""
        two_variances = 2.0 * self.sigma2_m**2
        return np.exp(-(np.square(x_m) + np.square(y_m)) / two_variances) / (
            math.pi * two_variances
        )

    def flux_um_per_s(self, x_m: ArrayLike, y_m: ArrayLike) -> np.ndarray:
        """Eq. (1): film growth [um/s] at points of the model plane [m]; arrays broadcast."""
        ring = self.f(x_m, y_m) * self.g1(x_m, y_m)
        return self.K1_cm3_per_s * ((1.0 - self.K2) * ring + self.K2 * self.g2(x_m, y_m))

    @property
    def peak_flux_um_per_s(self) -> float:
        """The strongest film growth of eq. (1) [um/s], good to 1e-4."""
        # Along this direction f is largest, but has no value at the very centre; the ring's top
        # lies between the centre and r.
        towards = self.phi_rad + 0.5 * math.pi
        rho = np.linspace(0.0, self.r_m, 129) + 1e-6
        return float(self.flux_um_per_s(rho * math.cos(towards), rho * math.sin(towards)).max())

    def radius_of_flux_m(self, fraction: float) -> float:
        """Radius beyond which the flux stays below ``fraction`` of its peak [m]."""
        limit = 0.5 * fraction * self.peak_flux_um_per_s / self.K1_cm3_per_s
        # g1 stays below twice its outer Gaussian, f below 1 + K3.
        ring = 2.0 * (1.0 - self.K2) * (1.0 + self.K3) / self.gamma_m2
        centre = self.K2 / (2.0 * math.pi * self.sigma2_m**2)
        # Within so many standard deviations each Gaussian falls to the limit.
        of_ring, of_centre = (
            math.sqrt(2.0 * math.log(max(peak / limit, 1.0))) for peak in (ring, centre)
        )
        return max(self.r_m + self.sigma1_m * of_ring, self.sigma2_m * of_centre)

    def enclosed_fraction(self, radius_m: ArrayLike) -> np.ndarray:
        """Share of the volume within a radius on the model plane [1]; arrays broadcast.

        The asymmetry integrates out over the angle, so only g1 and g2 count.
        """
        r, s = self.r_m, self.sigma1_m
        radius = np.asarray(radius_m, dtype=float)

        def primitive(u: np.ndarray | float, offset: float) -> np.ndarray:
            # Antiderivative of rho exp(-(rho - offset)^2 / 2 s^2), with u = rho - offset.
            gaussian = -(s**2) * np.exp(-(u**2) / (2.0 * s**2))
            inside = scipy.special.erf(u / (math.sqrt(2) * s))
            return gaussian + offset * s * math.sqrt(math.pi / 2.0) * inside

        ring = primitive(radius - r, r) - primitive(-r, r)
        mirrored = primitive(radius + r, -r) - primitive(r, -r)
        g1 = 2.0 * math.pi * (ring + mirrored) / self.gamma_m2
        g2 = 1.0 - np.exp(-(radius**2) / (2.0 * self.sigma2_m**2))
        return (1.0 - self.K2) * g1 + self.K2 * g2


# Messages carry the number in 32 bits.
MOST = 2**31 - 1


class BrushEntry(BaseModel):
    """A brush as a file gives it by its number: what the cell sets, None where not known."""

    model_config = ConfigDict(frozen=True, extra='forbid', allow_inf_nan=False)

    flow_cm3_per_min: float | None = Field(
        None, gt=0.0, le=10_000.0, description='wet paint at relative flow 1 [cm3/min]'
    )
    shaping_air_l_per_min: float | None = Field(
        None, gt=0.0, le=10_000.0, description='shaping air at standard conditions [l/min]'
    )
    bell_speed_rpm: float | None = Field(
        None, gt=0.0, le=200_000.0, description='speed of the bell cup [rev/min]'
    )
    voltage_kv: float | None = Field(
        None, gt=0.0, le=200.0, description='high voltage, its magnitude [kV]'
    )
    solids: float | None = Field(
        None, gt=0.0, le=1.0, description='share of solids in the volume of the wet paint [1]'
    )
    density_g_per_cm3: float | None = Field(
        None, gt=0.0, le=20.0, description='of the wet paint [g/cm3]'
    )
    planar: Any = Field(None, description='a mapping: eq. (1) as measured at the set-points')


class Brush(BrushEntry):
    """The pattern of eq. (1) at one setting of the atomizer."""

    number: int = Field(ge=1, le=MOST)  # by which programmes choose it
    planar: PlanarPattern


def listed(numbers: Iterable[int]) -> str:
    """Numbers of brushes in words."""
    return ', '.join(map(str, sorted(numbers)))
