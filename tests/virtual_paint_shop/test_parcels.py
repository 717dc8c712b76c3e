"""The plume is eq. (1), solids are kept, and the noise of counting parcels is small."""

import numpy as np
import pytest

from . import conner
from .bench import still_air
from .doors import Part, draw_door
from .flight import Slices, film_um, fly
from .gauge import scatter
from .jobs import Plan, drive, slices
from .parcels import Pattern, conner_plume
from .shop import PARCELS

PATTERN = Pattern(1.5, K2=0.2, K3=0.25, phi_rad=0.7, r_m=0.12, sigma1_m=0.05, sigma2_m=0.08)


def test_parcels_follow_equation_1_in_every_sector():
    """Shares in 8 x 12 polar cells agree with the integral of eq. (1) over each cell."""
    plume = conner_plume(PATTERN, 1 << 18, seed=3)
    radii, angles = np.linspace(0.0, 0.32, 9), np.linspace(-np.pi, np.pi, 13)
    counted, _, _ = np.histogram2d(
        np.hypot(plume.x_m, plume.y_m), np.arctan2(plume.y_m, plume.x_m), [radii, angles]
    )
    fine = 24
    rho = np.linspace(0.0, 0.32, 8 * fine + 1)
    t = np.linspace(-np.pi, np.pi, 12 * fine + 1)
    rho, t = 0.5 * (rho[1:] + rho[:-1])[:, None], 0.5 * (t[1:] + t[:-1])[None, :]
    cell = conner.planar_flux(PATTERN, rho * np.cos(t), rho * np.sin(t)) * rho
    cell *= (0.32 / (8 * fine)) * (2 * np.pi / (12 * fine)) / PATTERN.K1_cm3_per_s
    expected = cell.reshape(8, fine, 12, fine).sum(axis=(1, 3)) * (1 << 18)
    chi_square = np.sum((counted - expected) ** 2 / expected)
    assert chi_square < 96 * 0.5  # even points: far below the 96 of independent ones
    assert np.abs(counted / expected - 1.0)[expected > 300].max() < 0.05


@pytest.mark.slow
def test_all_solids_of_a_still_gun_are_on_a_wide_plane():
    plane, tilt = Part('panel', 2.4, 2.4), np.deg2rad(25.0)
    axis = np.array([0.0, -np.cos(tilt), np.sin(tilt)])
    turn = np.stack([[1.0, 0.0, 0.0], np.cross(axis, [1.0, 0.0, 0.0]), axis], axis=-1)[None]
    tcp = np.array([[0.0, 0.25, 1.2]])
    flow = np.array([PATTERN.K1_cm3_per_s])
    still = Slices(np.zeros(1), np.ones(1), tcp, tcp, turn, turn, flow, flow)
    plume = conner_plume(PATTERN, 1 << 18, seed=5)
    x, z = np.meshgrid(np.linspace(-1.15, 1.15, 116), np.linspace(0.05, 2.35, 116))
    points = plane.point(x.ravel(), z.ravel())
    landed = film_um(
        fly(plane, still, plume, still_air(still, plume), points, 0.30, 0.05, 1 << 18),
        points.shape[0],
    )
    assert landed.sum() * 0.02**2 == pytest.approx(PATTERN.K1_cm3_per_s, rel=0.005)


@pytest.mark.slow
def test_clean_film_on_a_door_is_equation_2():
    """Bias below 0.05 um and counting noise below 0.3 um, at the default number of parcels."""
    rng = np.random.default_rng(8)
    door = draw_door(rng)
    motion = drive(door, Plan(index_m=0.25, passes=4, speed_m_per_s=0.28, roll_rad=0.4), rng)
    x, z = scatter(door, 120, rng, 0.015)
    points = door.point(x, z)
    plume = conner_plume(PATTERN, 1 << 19, seed=5)
    cut = slices(motion, lambda t: PATTERN.K1_cm3_per_s * motion.commanded(t))
    film = film_um(fly(door, cut, plume, still_air(cut, plume), points, 0.30, 0.05, PARCELS), 120)
    theory = conner.film_um(PATTERN, motion, points, door.normal(x, z))
    assert 10.0 < theory.mean() < 40.0
    assert abs(np.mean(film - theory)) < 0.05
    assert np.std(film - theory) / theory.mean() < 0.01
    assert np.std(film - theory) < 0.3
