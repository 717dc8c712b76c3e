"""Eqs. (4) and (5): endless and finite rasters."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.pass_film import sampled_collapse
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.model.eq3_collapse import ThreeGaussianCollapse
from paint_deposition.model.eq4_eq5_uniformity import ParallelPasses

EQ3 = ThreeGaussianCollapse(
    K1_um_m=9.0, K2_um_m=6.0, K3_um_m=8.0,
    r1_m=0.22, r2_m=0.2, sigma1_m=0.09, sigma2_m=0.1, sigma3_m=0.15,
)  # fmt: skip
MIRRORED = ThreeGaussianCollapse(
    K1_um_m=6.0, K2_um_m=9.0, K3_um_m=8.0,
    r1_m=0.2, r2_m=0.22, sigma1_m=0.1, sigma2_m=0.09, sigma3_m=0.15,
)  # fmt: skip
INDICES_M = (0.2, 0.31, 0.577, 0.8)


def sigma_n_by_quadrature(collapse, index_m):
    """Eqs. (4) and (5) to the letter, adaptively."""
    mean = collapse.area_um_m / index_m
    images = np.arange(-40, 41) * index_m

    def integrand(x):
        return (collapse.thickness_um(x + images).sum() / mean - 1.0) ** 2

    value, _ = quad(
        integrand, -0.5 * index_m, 0.5 * index_m, epsabs=1e-14, epsrel=1e-12, limit=500
    )
    return math.sqrt(value / index_m)


@pytest.mark.parametrize('index_m', INDICES_M)
def test_sigma_n_matches_adaptive_quadrature(index_m):
    expected = sigma_n_by_quadrature(EQ3, index_m)
    assert ParallelPasses.one_way(EQ3).sigma_n(index_m) == pytest.approx(expected, abs=1e-9)


def test_single_gaussian_has_its_known_sigma_n():
    """One Gaussian: sigma_n^2 = 2 sum exp(-(2 pi k sigma / index)^2)."""
    sigma, index = 0.12, 0.4
    one = ThreeGaussianCollapse(
        K1_um_m=3.0, K2_um_m=2.0, K3_um_m=1.0, r1_m=0.0, r2_m=0.0,
        sigma1_m=sigma, sigma2_m=sigma, sigma3_m=sigma,
    )  # fmt: skip
    k = np.arange(1, 20)
    expected = math.sqrt(2.0 * np.sum(np.exp(-((2.0 * math.pi * k * sigma / index) ** 2))))
    assert ParallelPasses.one_way(one).sigma_n(index) == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize(
    ('index_m', 'percent'), [(0.525, 10.8), (0.577, 3.4), (0.600, 4.8), (0.625, 9.2)]
)
def test_ring_pattern_is_most_even_near_its_half_width(index_m, percent):
    """Figures computed apart from this code for (K2, r, s1, s2) = (0.15, 220, 90, 150 mm)."""
    planar = PlanarPattern(K2=0.15, K3=0.0, r_m=0.22, sigma1_m=0.09, sigma2_m=0.15)
    raster = ParallelPasses.one_way(sampled_collapse(DepositionModel(planar=planar), 0.2))
    assert 100.0 * raster.sigma_n(index_m) == pytest.approx(percent, abs=0.06)


def test_alternating_mirrored_passes():
    raster = ParallelPasses(EQ3, MIRRORED)
    index = 0.5
    x = np.linspace(0.0, 2.0 * index, 4001)[:-1]
    by_hand = sum(
        EQ3.thickness_um((x - k * index) * (-1.0 if k % 2 else 1.0)) for k in range(-10, 12)
    )
    np.testing.assert_allclose(raster.thickness_um(index, x), by_hand, rtol=1e-12)
    assert raster.sigma_n(index) == pytest.approx(by_hand.std() / by_hand.mean(), rel=1e-9)
    assert raster.sigma_n(index) > 1.01 * ParallelPasses.one_way(EQ3).sigma_n(index)
