"""Eq. (3), and eq. (1) along a line of the model plane."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from paint_deposition.model.eq3_collapse import ThreeGaussianCollapse, line_integral_um_m_per_s
from patterns import PATTERNS

EQ3 = ThreeGaussianCollapse(
    K1_um_m=9.0, K2_um_m=6.0, K3_um_m=8.0,
    r1_m=0.22, r2_m=0.2, sigma1_m=0.09, sigma2_m=0.1, sigma3_m=0.15,
)  # fmt: skip


def test_eq3_is_the_papers_formula():
    x, c = 0.13, EQ3
    expected = (
        1.0
        / (3.0 * math.sqrt(2.0 * math.pi))
        * (
            c.K1_um_m / c.sigma1_m * math.exp(-((x - c.r1_m) ** 2) / (2 * c.sigma1_m**2))
            + c.K2_um_m / c.sigma2_m * math.exp(-((x + c.r2_m) ** 2) / (2 * c.sigma2_m**2))
            + c.K3_um_m / c.sigma3_m * math.exp(-(x**2) / (2 * c.sigma3_m**2))
        )
    )
    assert c.thickness_um(x) == pytest.approx(expected, rel=1e-14)
    assert c.components_um(np.full((4, 2), x)).shape == (3, 4, 2)


def test_eq3_area_is_a_third_of_the_gains():
    area, _ = quad(EQ3.thickness_um, -2.0, 2.0, epsabs=1e-12, points=[0.0])
    assert pytest.approx(area, rel=1e-10) == EQ3.area_um_m
    assert EQ3.scaled(3.0).area_um_m == pytest.approx(3.0 * EQ3.area_um_m)
    assert EQ3.thickness_um(EQ3.reach_m) < 1e-8 * EQ3.thickness_um(0.0)


@pytest.mark.parametrize('name', PATTERNS)
@pytest.mark.parametrize('travel_rad', [0.0, 2.5])
def test_line_integral_matches_adaptive_quadrature_of_eq1(name, travel_rad):
    planar = PATTERNS[name]
    along = np.array([math.cos(travel_rad), math.sin(travel_rad)])
    left = np.array([-along[1], along[0]])
    distances = np.array([-0.31, -0.02, 1e-5, 0.1, 0.25])
    film = line_integral_um_m_per_s(planar, distances, travel_rad)
    for distance, got in zip(distances, film, strict=True):

        def flux(t, distance=distance):
            x, y = t * along + distance * left
            return float(planar.flux_um_per_s(x, y))

        expected = sum(
            quad(flux, a, b, epsabs=1e-11, epsrel=1e-11, limit=400)[0]
            for a, b in [(-2.0, -0.3), (-0.3, 0.0), (0.0, 0.3), (0.3, 2.0)]
        )
        assert got == pytest.approx(expected, abs=1e-10 * film.max())
