"""The 1D collapse: the film that one long straight pass leaves, across the direction of travel.

Eq. (3) of Conner et al. (IROS 2002) is a model of its own, three Gaussians. What eq. (1) leaves
along a line of the model plane is here, too; with eq. (2) and effects see ``film/pass_film.py``.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.interpolate import CubicSpline

from paint_deposition.model.eq1_pattern import PlanarPattern

# Film below this share of the peak is left out of sums over passes.
NEGLIGIBLE = 1e-9


class ThreeGaussianCollapse(BaseModel):
    """Eq. (3), with the paper's symbols and signs: r1 lies at +x, r2 at -x, the third at 0.

    A gain K is in um m: K / sigma is a film thickness. A third of their sum is the area.
    """

    model_config = ConfigDict(frozen=True, extra='forbid', allow_inf_nan=False)

    K1_um_m: float = Field(description='K1, gain of the Gaussian at +r1 [um m]')
    K2_um_m: float = Field(description='K2, gain of the Gaussian at -r2 [um m]')
    K3_um_m: float = Field(description='K3, gain of the centred Gaussian [um m]')
    r1_m: float = Field(description='r_1, offset radius towards +x [m]')
    r2_m: float = Field(description='r_2, offset radius towards -x [m]')
    sigma1_m: float = Field(gt=0.0, description='sigma_1, of the Gaussian at +r1 [m]')
    sigma2_m: float = Field(gt=0.0, description='sigma_2, of the Gaussian at -r2 [m]')
    sigma3_m: float = Field(gt=0.0, description='sigma_3, of the centred Gaussian [m]')

    @property
    def gains_um_m(self) -> np.ndarray:
        """(3,) K1, K2, K3 [um m]."""
        return np.array([self.K1_um_m, self.K2_um_m, self.K3_um_m])

    @property
    def centres_m(self) -> np.ndarray:
        """(3,) where the Gaussians stand: r1, -r2, 0 [m]."""
        return np.array([self.r1_m, -self.r2_m, 0.0])

    @property
    def sigmas_m(self) -> np.ndarray:
        """(3,) standard deviations [m]."""
        return np.array([self.sigma1_m, self.sigma2_m, self.sigma3_m])

    def components_um(self, x_m: np.ndarray) -> np.ndarray:
        """(3, ...) film of each Gaussian at x (...) [um]; their sum is the film."""
        away = (np.asarray(x_m)[..., np.newaxis] - self.centres_m) / self.sigmas_m
        heights = self.gains_um_m / (3.0 * math.sqrt(2.0 * math.pi) * self.sigmas_m)
        return np.moveaxis(heights * np.exp(-0.5 * away**2), -1, 0)

    def thickness_um(self, x_m: np.ndarray) -> np.ndarray:
        """Eq. (3): c(x) [um] at x [m]; arrays of any shape."""
        return self.components_um(x_m).sum(axis=0)

    @property
    def area_um_m(self) -> float:
        """Integral of c over x [um m]."""
        return float(self.gains_um_m.sum()) / 3.0

    @property
    def reach_m(self) -> float:
        """Distance beyond which the film is below 1e-9 of the peak [m]."""
        deviations = math.sqrt(2.0 * math.log(3.0 / NEGLIGIBLE))
        return float(np.max(np.abs(self.centres_m) + deviations * self.sigmas_m))

    @property
    def finest_m(self) -> float:
        """Least standard deviation [m]."""
        return float(self.sigmas_m.min())

    def scaled(self, factor: float) -> 'ThreeGaussianCollapse':
        """All thicknesses times a factor."""
        gains = {f'K{k + 1}_um_m': factor * gain for k, gain in enumerate(self.gains_um_m)}
        return self.model_copy(update=gains)


@dataclass(frozen=True)
class SampledCollapse:
    """A profile at (N,) rising distances, next to nothing at both ends; a cubic spline between."""

    x_m: np.ndarray
    film_um: np.ndarray
    finest_m: float

    @cached_property
    def _spline(self) -> CubicSpline:
        return CubicSpline(self.x_m, self.film_um)

    def thickness_um(self, x_m: np.ndarray) -> np.ndarray:
        """Film [um] at x [m]; arrays of any shape."""
        x = np.asarray(x_m, dtype=float)
        inside = (x >= self.x_m[0]) & (x <= self.x_m[-1])
        return np.where(inside, self._spline(np.where(inside, x, self.x_m[0])), 0.0)

    @cached_property
    def area_um_m(self) -> float:
        """Integral of the film over x [um m]."""
        return float(self._spline.integrate(self.x_m[0], self.x_m[-1]))

    @property
    def reach_m(self) -> float:
        """Distance beyond which there is no film [m]."""
        return float(np.abs(self.x_m[[0, -1]]).max())

    def scaled(self, factor: float) -> 'SampledCollapse':
        """All thicknesses times a factor."""
        return SampledCollapse(self.x_m, factor * self.film_um, self.finest_m)


# A film profile across the direction of travel.
Collapse = ThreeGaussianCollapse | SampledCollapse


def half_width_m(collapse: Collapse) -> float:
    """SB50: width of a profile between its outermost places at half its peak [m]."""
    x = np.linspace(-collapse.reach_m, collapse.reach_m, 4001)
    film = collapse.thickness_um(x)
    above = x[film >= 0.5 * film.max()]
    return float(above[-1] - above[0])


def sb50_m(planar: PlanarPattern) -> float:
    """SB50 on the model plane of a pass along tool y, so that its width lies along tool x [m]."""
    reach_m = planar.radius_of_flux_m(1e-4)
    across_m = np.linspace(-reach_m, reach_m, 801)
    film_um = line_integral_um_m_per_s(planar, across_m)
    return half_width_m(SampledCollapse(across_m, film_um, planar.sigma1_m))


# Nodes of the line integral in the narrower standard deviation: trapezoids of a Gaussian with
# three of them are exact to 1e-15.
NODES_PER_SIGMA = 4.0


def line_integral_um_m_per_s(
    planar: PlanarPattern, across_m: np.ndarray, travel_rad: float = 0.0
) -> np.ndarray:
    """(N,) eq. (1) integrated over lines of the model plane [um m/s].

    The part of f that is odd along a line integrates to zero. What is left of it is smooth in u
    with distance along the line = |across| sinh(u), though not in the distance itself. Distances
    (N,) of the lines from the centre are positive along tool z times travel.
    """
    p = planar
    across = np.abs(np.atleast_1d(across_m)).astype(float)
    far = p.radius_of_flux_m(1e-14)
    step = p.sigma1_m / NODES_PER_SIGMA
    along = step * np.arange(math.ceil(far / step) + 1)
    ring = _even_sum(p.g1(across[:, np.newaxis], along), step)
    # f is strongest at right angles to phi, ahead of it.
    lopsided = p.K3 * math.cos(travel_rad - p.phi_rad)
    if lopsided:
        side = np.sign(across_m).reshape(across.shape) * lopsided
        # |across| times the line integral of g1 over the radius; it vanishes at the centre.
        step = p.sigma1_m / NODES_PER_SIGMA / far
        u = step * np.arange(math.ceil(math.asinh(1e12) / step) + 1)
        over_radius = np.empty(len(across))
        for row, distance in enumerate(np.maximum(across, 1e-12 * far)):
            used = u[: math.ceil(math.asinh(far / distance) / step) + 1]
            over_radius[row] = distance * _even_sum(p.g1(distance * np.cosh(used), 0.0), step)
        ring = ring + side * over_radius
    centre = np.exp(-0.5 * (across / p.sigma2_m) ** 2) / (p.sigma2_m * math.sqrt(2.0 * math.pi))
    film = p.K1_cm3_per_s * ((1.0 - p.K2) * ring + p.K2 * centre)
    return film.reshape(np.shape(across_m))


def _even_sum(values: np.ndarray, step: float) -> np.ndarray:
    """Trapezoids over the whole line for an even function sampled from 0 on, last axis."""
    return step * (2.0 * values.sum(axis=-1) - values[..., 0])
