"""Eqs. (1), (3), (4) and (5): pattern, collapse, and rasters of passes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.integrate import quad

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.pass_film import sampled_collapse
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.model.eq3_collapse import ThreeGaussianCollapse
from paint_deposition.model.eq4_eq5_uniformity import ParallelPasses

ANY_PATTERN = st.builds(
    PlanarPattern, K1_cm3_per_s=st.floats(0.01, 100.0), K2=st.floats(0.0, 1.0),
    K3=st.floats(0.0, 1.0), phi_rad=st.floats(-6.28, 6.28), r_m=st.floats(0.0, 1.0),
    sigma1_m=st.floats(0.005, 1.0), sigma2_m=st.floats(0.005, 1.0),
)  # fmt: skip


def test_gamma_by_hand():
    # r = 0: two Gaussians upon each other, 2 * 2 pi sigma^2.
    assert PlanarPattern(r_m=0.0, sigma1_m=0.1).gamma_m2 == pytest.approx(0.04 * math.pi)
    # r = 0.22, sigma_1 = 0.09: exp(-2.98765) = 0.0504056, erf(1.728483) = 0.9854991;
    # 2 pi (0.0162 * 0.0504056 + 0.0198 * 2.5066283 * 0.9854991).
    assert PlanarPattern(r_m=0.22, sigma1_m=0.09).gamma_m2 == pytest.approx(0.312448, abs=2e-6)
    # A thin ring is a line of length 2 pi r and width sigma sqrt(2 pi).
    thin = PlanarPattern(r_m=0.5, sigma1_m=0.005)
    assert thin.gamma_m2 == pytest.approx(math.pi * 0.005 * math.sqrt(2 * math.pi), rel=1e-12)


def test_flux_by_hand():
    # K2 = 1 leaves the centred Gaussian: 2 / (2 pi 0.01) = 31.831 at its centre, in um/s.
    centred = PlanarPattern(K1_cm3_per_s=2.0, K2=1.0, sigma2_m=0.1)
    assert centred.flux_um_per_s(0.0, 0.0) == pytest.approx(100.0 / math.pi)
    assert centred.flux_um_per_s(0.06, 0.08) == pytest.approx(100.0 / math.pi * math.exp(-0.5))
    # K2 = 0 leaves the ring: at rho = r the second exponential is exp(-2 r^2 / sigma^2).
    ring = PlanarPattern(K1_cm3_per_s=1.0, K2=0.0, K3=0.5, phi_rad=0.0, r_m=0.1, sigma1_m=0.1)
    top = (1.0 + math.exp(-2.0)) / ring.gamma_m2
    assert ring.flux_um_per_s(0.1, 0.0) == pytest.approx(top)
    assert ring.flux_um_per_s(0.0, 0.1) == pytest.approx(1.5 * top)
    assert ring.flux_um_per_s(0.0, -0.1) == pytest.approx(0.5 * top)


@pytest.mark.parametrize('radius_m', [0.0, 0.05, 0.22, 0.4, 2.0])
@pytest.mark.parametrize('r_m', [0.0, 0.1, 0.22])
def test_enclosed_fraction_is_the_integral_up_to_there(radius_m, r_m):
    pattern = PlanarPattern(r_m=r_m)

    def ring(rho):
        mean = (1.0 - pattern.K2) * pattern.g1(rho, 0.0) + pattern.K2 * pattern.g2(rho, 0.0)
        return 2.0 * math.pi * rho * mean

    expected = quad(ring, 0.0, radius_m, epsabs=1e-12, points=[0.2], limit=200)[0]
    assert pattern.enclosed_fraction(radius_m) == pytest.approx(expected, abs=1e-10)


@given(pattern=ANY_PATTERN, x_m=st.floats(-3.0, 3.0), y_m=st.floats(-3.0, 3.0))
def test_flux_is_never_negative_and_nowhere_above_the_peak(pattern, x_m, y_m):
    flux = float(pattern.flux_um_per_s(x_m, y_m))
    assert 0.0 <= flux <= 1.001 * pattern.peak_flux_um_per_s


@given(
    pattern=ANY_PATTERN, fraction=st.sampled_from([1e-3, 1e-6, 1e-9]), angle=st.floats(-3.2, 3.2)
)
def test_beyond_its_radius_the_flux_is_negligible(pattern, fraction, angle):
    rho = pattern.radius_of_flux_m(fraction) * np.linspace(1.0, 1.5, 50)
    beyond = pattern.flux_um_per_s(rho * math.cos(angle), rho * math.sin(angle))
    assert beyond.max() <= 1.01 * fraction * pattern.peak_flux_um_per_s


@pytest.mark.parametrize(
    'wrong',
    [{'K1_cm3_per_s': 0.0}, {'K2': -0.1}, {'K2': 1.1}, {'K3': 1.2}, {'r_m': -0.01},
     {'sigma1_m': 0.0}, {'sigma2_m': math.nan}, {'K1': 1.9}],
)  # fmt: skip
def test_impossible_parameters_are_refused(wrong):
    with pytest.raises(ValidationError, match=next(iter(wrong))):
        PlanarPattern(**wrong)


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


MIRRORED = ThreeGaussianCollapse(
    K1_um_m=6.0, K2_um_m=9.0, K3_um_m=8.0,
    r1_m=0.2, r2_m=0.22, sigma1_m=0.1, sigma2_m=0.09, sigma3_m=0.15,
)  # fmt: skip


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


@pytest.mark.parametrize(
    ('second', 'index_m'), [*((EQ3, at) for at in (0.2, 0.31, 0.577, 0.8)), (MIRRORED, 0.5)]
)
def test_the_film_of_passes_is_their_sum_and_sigma_n_its_deviation_over_its_mean(second, index_m):
    raster = ParallelPasses(EQ3, second)
    x = np.linspace(0.0, 2.0 * index_m, 4001)[:-1]
    by_hand = sum((second if k % 2 else EQ3).thickness_um(x - k * index_m) for k in range(-10, 12))
    np.testing.assert_allclose(raster.thickness_um(index_m, x), by_hand, rtol=1e-12)
    tolerance = {'rel': 1e-9} if second is MIRRORED else {'abs': 1e-9}
    assert raster.sigma_n(index_m) == pytest.approx(by_hand.std() / by_hand.mean(), **tolerance)
    one_way = ParallelPasses.one_way(EQ3).sigma_n(index_m)
    assert (raster.sigma_n(index_m) > 1.01 * one_way) == (second is MIRRORED)
