"""The equations beside measured profiles, which are not shipped: what fits say of them is."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from paint_deposition.inference.fitting.panel import Panel, fit_collapse
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.part.points import SurfacePoints
from scenes import painted, straight_pass

SHIPPED = json.loads(Path(__file__).with_name('real_profiles.json').read_text())


def table(path: Path) -> np.ndarray:
    """(columns, N) numbers of a CSV below its header."""
    return np.loadtxt(path, delimiter=',', skiprows=1).T


def fitted_spot(radius_m: np.ndarray, thickness: np.ndarray) -> PlanarPattern:
    """Eq. (1) without asymmetry fitted to a radial profile."""

    def pattern(x: np.ndarray) -> PlanarPattern:
        return PlanarPattern(
            K1_cm3_per_s=math.exp(x[0]), K2=x[1], K3=0.0, phi_rad=0.0,
            r_m=x[2], sigma1_m=math.exp(x[3]), sigma2_m=math.exp(x[4]),
        )  # fmt: skip

    found = [
        least_squares(
            lambda x: pattern(x).flux_um_per_s(radius_m, 0.0) - thickness,
            [math.log(0.4), k2, 0.05, math.log(0.05), math.log(0.1)],
            bounds=([-6.0, 0.0, 0.0, -5.0, -5.0], [4.0, 1.0, 0.5, 0.0, 0.0]),
        )
        for k2 in (0.2, 0.5, 0.8)
    ]
    return pattern(min(found, key=lambda one: one.cost).x)


def share_on_the_axis(angle_deg: np.ndarray) -> np.ndarray:
    """Eq. (2) on the gun's axis at spray angles (N,), relative to the largest."""
    lean = np.radians(90.0 - angle_deg)
    normals = np.stack([np.sin(lean), np.zeros(len(lean)), -np.cos(lean)], axis=1)
    above = (0.0, 0.0, -0.25)
    still = straight_pass(np.linspace(0.0, 1.0, 11), above, above, quaternion=(0.0, 0.0, 0.0, 1.0))
    film = painted(SurfacePoints(np.zeros((len(lean), 3)), normals), still, precision='double')
    return film.film_um / film.film_um.max()


def test_eqs_1_and_3_follow_a_static_spot_and_a_moving_sprinkler(shared_data):
    # Feet and inches take the places of metres and micrometres.
    station_ft, depth_in = table(shared_data / 'travelling_gun_transect_1d_collapse.csv')
    one_pass = Panel(station_ft, np.zeros(1), np.ones(1), np.zeros(1, dtype=bool), 1.0, 0.0)
    found = fit_collapse(one_pass, depth_in, np.full(len(depth_in), 0.05))
    assert found.model_dump() == pytest.approx(SHIPPED['eq3'], rel=1e-4, abs=1e-9)
    _, radius_mm, thickness = table(shared_data / 'magnetron_static_radial_130mm.csv')
    thickness = thickness / 100.0
    pattern = fitted_spot(radius_mm * 1e-3, thickness)
    assert pattern.model_dump() == pytest.approx(SHIPPED['eq1'], rel=1e-4, abs=1e-9)
    residual = thickness - pattern.flux_um_per_s(radius_mm * 1e-3, 0.0)
    assert np.sqrt(np.mean(residual**2)) < 0.01 * thickness.max()
    assert np.abs(residual).max() < 0.03 * thickness.max()
    assert 0.03 < pattern.r_m < 0.07
    assert 0.3 < pattern.K2 < 0.9


def test_thickness_falls_with_the_cosine_that_eq2_has_and_hardly_with_the_standoff(shared_data):
    """Particles of 600 m/s fly nearly parallel: neither 1 / L of a track nor 1 / L^2 of a spot."""
    measured = table(shared_data / 'hvof_wc17co_thickness_angle_standoff.csv')
    angle, standoff, thickness, *_ = measured
    cosine = share_on_the_axis(angle)
    terms = np.stack([np.ones(len(angle)), np.log(cosine), np.log(standoff)], axis=1)
    best, rest, _, _ = np.linalg.lstsq(terms, np.log(thickness), rcond=None)
    variance = rest[0] / (len(terms) - terms.shape[1])
    error = np.sqrt(np.diag(variance * np.linalg.inv(terms.T @ terms)))
    found = [best[1], error[1], best[2], error[2]]
    assert found == pytest.approx([*SHIPPED['eq2'].values()], rel=1e-4)
    assert best[1] == pytest.approx(1.0, abs=error[1])
    assert error[1] < 0.1
    assert 2.0 * error[2] < best[2] < 0.5
