"""A learned footprint: what the spray pattern deposits deviates over the model plane."""

import numpy as np
import pytest
from numba import float32, float64, njit

from booth import MODEL, painted, panel, spot
from paint_deposition.effects.learned.law import WAVES, LearnedFootprint
from paint_deposition.kernel.laws import Ray, in_precision

REACH_M = 0.2
STEP_M = REACH_M / 4
# At each of five radii, of which the innermost has no direction.
RINGS = np.random.default_rng(2).uniform(-0.15, 0.15, size=(5, WAVES))
RINGS[0, 1:] = 0.0
LAW = LearnedFootprint(reach_m=REACH_M, learned=tuple(RINGS.ravel()))


def at(x_m: float, y_m: float) -> Ray:
    """A ray that pierces the model plane here."""
    return Ray(x_m, y_m, 1.1, 0.9, 0.4)


@pytest.mark.slow
@pytest.mark.parametrize(('real', 'tolerance'), [(np.float64, 1e-12), (np.float32, 1e-5)])
def test_the_compiled_factor_is_one_plus_h_in_its_own_precision(real, tolerance):
    compiled = njit(in_precision(LAW.flux_factor, real))
    values = np.array(LAW.values(), real)
    x_m, y_m = np.random.default_rng(3).uniform(-1.3 * REACH_M, 1.3 * REACH_M, size=(2, 60))
    found = [
        compiled(Ray(*np.array(at(x, y), real)), *values) for x, y in zip(x_m, y_m, strict=True)
    ]
    np.testing.assert_allclose(found, 1.0 + LAW.h(x_m, y_m), rtol=tolerance)
    (signature,) = compiled.nopython_signatures
    assert signature.return_type == {np.float64: float64, np.float32: float32}[real]


def test_at_its_radii_it_has_the_mean_and_the_harmonics_that_were_given():
    angle = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    table = [np.ones(12), np.cos(angle), np.sin(angle), np.cos(2 * angle), np.sin(2 * angle)]
    for ring, values in enumerate(RINGS):
        radius = ring * STEP_M
        found = LAW.h(radius * np.cos(angle), radius * np.sin(angle))
        np.testing.assert_allclose(found, values @ table, atol=1e-9)


def test_between_two_radii_it_is_linear_and_one_step_beyond_reach_nothing():
    along = LAW.h(np.array([1.0, 1.25, 2.0]) * STEP_M, np.zeros(3))
    assert along[1] == pytest.approx(0.75 * along[0] + 0.25 * along[2])
    beyond = np.array([REACH_M + STEP_M, 3.0 * REACH_M])
    assert LAW.h(beyond, np.zeros(2)).tolist() == [0.0, 0.0]
    for radius in beyond:
        assert LAW.flux_factor(at(0.0, radius), *LAW.values()) == 1.0


@pytest.mark.parametrize('x_m', [0.0, 1e-12])
def test_at_the_very_centre_it_is_finite(x_m):
    assert LAW.flux_factor(at(x_m, 0.0), *LAW.values()) == pytest.approx(1.0 + RINGS[0, 0])


def volume_um_m2(*effects) -> float:
    """Paint on the panel in front of a gun that stands still for a second."""
    surface = panel(0.5, 0.01)
    return float(painted(surface, spot(), *effects).raw_um.sum())


def of_the_pattern(h) -> float:
    """Integral over the model plane of the pattern times a function of the place."""
    line = np.linspace(-0.6, 0.6, 801)
    x, y = np.meshgrid(line, line)
    return float((MODEL.planar.flux_um_per_s(x, y) * h(x, y)).sum())


@pytest.mark.slow
def test_the_paint_on_a_flat_panel_changes_as_the_integral_of_the_pattern():
    """All that passes the model plane lands on the panel, wherever it passes."""
    expected = of_the_pattern(lambda x, y: 1.0 + LAW.h(x, y)) / of_the_pattern(lambda x, y: 1.0)
    assert abs(expected - 1.0) > 0.01
    assert volume_um_m2(LAW) / volume_um_m2() == pytest.approx(expected, abs=3e-4)
