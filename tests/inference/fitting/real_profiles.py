"""Fits of eqs. (1) to (3) to profiles measured on other people's machines."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import curve_fit, least_squares

from paint_deposition.inference.fitting.panel_fit import CollapseFit, fit_collapse
from paint_deposition.inference.readings.panel import Panel
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.model.eq2_projection import Projection, flux_um_per_s

LANE_SPACING_FT = 224.0


def table(path: Path) -> np.ndarray:
    """(N, columns) numbers of a CSV below its header."""
    return np.loadtxt(path, delimiter=',', skiprows=1)


@dataclass(frozen=True)
class Transect:
    """A moving sprinkler's transect [ft, in], eq. (3) and one Gaussian fitted to it."""

    station_ft: np.ndarray
    depth_in: np.ndarray
    three: CollapseFit
    height_in: float
    sigma_ft: float

    @property
    def one_in(self) -> np.ndarray:
        """(N,) the single Gaussian at the stations."""
        return self.height_in * np.exp(-0.5 * (self.station_ft / self.sigma_ft) ** 2)


def transect(folder: Path) -> Transect:
    """The measured transect and its fits."""
    return fitted_transect(*table(folder / 'travelling_gun_transect_1d_collapse.csv').T)


def fitted_transect(station: np.ndarray, depth: np.ndarray) -> Transect:
    """Fit a transect; feet and inches take the places of metres and micrometres."""
    one_pass = Panel(station, np.zeros(1), np.ones(1), np.zeros(1, dtype=bool), 1.0, 0.0)
    three = fit_collapse(one_pass, depth, np.full(len(depth), 0.05))

    def gaussian(x, height, sigma):
        return height * np.exp(-0.5 * (x / sigma) ** 2)

    (height, sigma), _ = curve_fit(gaussian, station, depth, [0.9, 70.0])
    return Transect(station, depth, three, float(height), float(sigma))


@dataclass(frozen=True)
class Spot:
    """A static radial profile at 130 mm and eq. (1) without asymmetry fitted to it."""

    radius_m: np.ndarray
    thickness: np.ndarray
    pattern: PlanarPattern

    @property
    def fitted(self) -> np.ndarray:
        """(N,) eq. (1) at the radii."""
        return self.pattern.flux_um_per_s(self.radius_m, 0.0)


def spot(folder: Path) -> Spot:
    """The magnetron's profile, in hundredths of its unit, and its fit."""
    _, radius_mm, thickness = table(folder / 'magnetron_static_radial_130mm.csv').T
    return fitted_spot(radius_mm * 1e-3, thickness / 100.0)


def fitted_spot(radius: np.ndarray, thickness: np.ndarray) -> Spot:
    """Fit eq. (1) without asymmetry to a radial profile."""

    def pattern(x: np.ndarray) -> PlanarPattern:
        return PlanarPattern(
            K1_cm3_per_s=math.exp(x[0]), K2=x[1], K3=0.0, phi_rad=0.0,
            r_m=x[2], sigma1_m=math.exp(x[3]), sigma2_m=math.exp(x[4]),
        )  # fmt: skip

    found = [
        least_squares(
            lambda x: pattern(x).flux_um_per_s(radius, 0.0) - thickness,
            [math.log(0.4), k2, 0.05, math.log(0.05), math.log(0.1)],
            bounds=([-6.0, 0.0, 0.0, -5.0, -5.0], [4.0, 1.0, 0.5, 0.0, 0.0]),
        )
        for k2 in (0.2, 0.5, 0.8)
    ]
    return Spot(radius, thickness, pattern(min(found, key=lambda one: one.cost).x))


@dataclass(frozen=True)
class Inclined:
    """HVOF coating over spray angle and standoff; the axis' share by eq. (2) at each angle."""

    angle_deg: np.ndarray
    standoff_mm: np.ndarray
    thickness_um: np.ndarray
    share: np.ndarray

    @property
    def exponents(self) -> tuple[float, float, float, float]:
        """Exponent of the cosine law and of the standoff, each with its standard error."""
        terms = np.column_stack(
            [np.ones(len(self.share)), np.log(self.share), np.log(self.standoff_mm)]
        )
        best, rest, _, _ = np.linalg.lstsq(terms, np.log(self.thickness_um), rcond=None)
        variance = rest[0] / (len(terms) - terms.shape[1])
        error = np.sqrt(np.diag(variance * np.linalg.inv(terms.T @ terms)))
        return float(best[1]), float(error[1]), float(best[2]), float(error[2])


def inclined(folder: Path) -> Inclined:
    """Read the coating's thicknesses and project the axis onto surfaces inclined as much."""
    angle, standoff, thickness = table(folder / 'hvof_wc17co_thickness_angle_standoff.csv')[
        :, :3
    ].T
    return Inclined(angle, standoff, thickness, share_on_the_axis(angle))


def share_on_the_axis(angle_deg: np.ndarray) -> np.ndarray:
    """Eq. (2) on the gun's axis at spray angles (N,), relative to the largest."""
    lean = np.radians(90.0 - angle_deg)
    normals = np.stack([np.sin(lean), np.zeros(len(lean)), -np.cos(lean)], axis=1)
    projection = Projection()
    tcp = np.array([0.0, 0.0, -0.25])
    flux = flux_um_per_s(
        PlanarPattern(), projection, np.zeros((len(lean), 3)), normals, tcp, np.eye(3)
    )
    return flux / flux.max()


def figures(folder: Path) -> dict[str, dict[str, float]]:
    """What the fits to the measured profiles say, without the measurements themselves."""
    moving, static, coating = transect(folder), spot(folder), inclined(folder)
    cosine, cosine_error, standoff, standoff_error = coating.exponents
    return {
        'eq3': moving.three.collapse.model_dump(),
        'eq1': static.pattern.model_dump(),
        'eq2': {
            'cosine_exponent': cosine,
            'cosine_error': cosine_error,
            'standoff_exponent': standoff,
            'standoff_error': standoff_error,
        },
    }
