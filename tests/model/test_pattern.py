"""Eq. (1): both Gaussians integrate to one, so that K1 is the volume that lands a second."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.integrate import quad

from paint_deposition.model.eq1_pattern import PlanarPattern

PATTERNS = st.builds(
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


@given(pattern=PATTERNS, x_m=st.floats(-3.0, 3.0), y_m=st.floats(-3.0, 3.0))
def test_flux_is_never_negative_and_nowhere_above_the_peak(pattern, x_m, y_m):
    flux = float(pattern.flux_um_per_s(x_m, y_m))
    assert 0.0 <= flux <= 1.001 * pattern.peak_flux_um_per_s


@given(pattern=PATTERNS, fraction=st.sampled_from([1e-3, 1e-6, 1e-9]), angle=st.floats(-3.2, 3.2))
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
