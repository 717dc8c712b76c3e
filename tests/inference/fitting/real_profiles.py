"""Fits of eqs. (1) to (3) to profiles measured on other people's machines, and their picture.

python tests/inference/fitting/real_profiles.py DATA_FOLDER PICTURE draws them.
"""

import math
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import curve_fit, least_squares

from paint_deposition.inference.fitting.collapse_fit import CollapseFit, fit_collapse
from paint_deposition.inference.readings.panel import Panel
from paint_deposition.model.pattern import PlanarPattern
from paint_deposition.model.projection import Projection, flux_um_per_s

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


def aicc(residual: np.ndarray, parameters: int) -> float:
    """Akaike's criterion for few data; the noise counts as a parameter."""
    n, k = len(residual), parameters + 1
    return n * math.log(np.mean(residual**2)) + 2 * k + 2 * k * (k + 1) / (n - k - 1)


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


def draw(folder: Path, picture: Path) -> None:
    """The three comparisons side by side."""
    from paint_deposition.report.pictures.chart import legend, new_figure, quiet, save_picture
    from paint_deposition.report.style import ACCENT, COMPONENTS, INK, MUTED

    figure = new_figure(13.0, 4.0)
    left, middle, right = figure.subplots(1, 3)

    one = transect(folder)
    quiet(left, 'station [ft]', 'depth [in]', 'Moving sprinkler: eq. (3)')
    x = np.linspace(-160.0, 160.0, 400)
    for part, colour in zip(one.three.collapse.components_um(x), COMPONENTS, strict=True):
        left.plot(x, part, color=colour, linewidth=1.0, linestyle='--')
    left.plot(x, one.three.collapse.thickness_um(x), color=ACCENT, linewidth=1.8, label='eq. (3)')
    single = one.height_in * np.exp(-0.5 * (x / one.sigma_ft) ** 2)
    left.plot(x, single, color=MUTED, linewidth=1.4, label='one Gaussian')
    left.plot(one.station_ft, one.depth_in, 'o', color=INK, markersize=4, label='measured')
    left.set_ylim(0.0, 1.2)
    legend(left, loc='upper right')

    static = spot(folder)
    quiet(middle, 'radius [mm]', 'thickness', 'Static magnetron at 130 mm: eq. (1)')
    radius = np.linspace(0.0, 0.3, 300)
    middle.plot(
        1e3 * radius, static.pattern.flux_um_per_s(radius, 0.0),
        color=ACCENT, linewidth=1.8, label='eq. (1)',
    )  # fmt: skip
    middle.plot(
        1e3 * static.radius_m, static.thickness, 'o', color=INK, markersize=4,
        label='measured',
    )  # fmt: skip
    middle.set_ylim(bottom=0.0)
    legend(middle, loc='upper right')

    coating = inclined(folder)
    quiet(right, 'spray angle [deg]', 'thickness [um]', 'HVOF coating: eq. (2)')
    normal = coating.thickness_um[coating.angle_deg == 90.0].mean()
    angle = np.linspace(20.0, 90.0, 100)
    right.plot(
        angle, normal * np.sin(np.radians(angle)), color=ACCENT, linewidth=1.8, label='cosine law'
    )
    for standoff, colour in zip(np.unique(coating.standoff_mm), (*COMPONENTS, INK), strict=True):
        there = coating.standoff_mm == standoff
        right.plot(
            coating.angle_deg[there], coating.thickness_um[there], 'o', color=colour,
            markersize=4, label=f'{standoff:.0f} mm',
        )  # fmt: skip
    right.set_ylim(bottom=0.0)
    legend(right, loc='lower right')
    save_picture(figure, picture)


if __name__ == '__main__':
    draw(Path(sys.argv[1]), Path(sys.argv[2]))
