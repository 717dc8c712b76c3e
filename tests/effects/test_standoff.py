"""Effects of the distance from the bell."""

import numpy as np
import pytest

from booth import MODEL, painted, panel, spot
from paint_deposition.effects.library.pattern_spread import PatternSpread
from paint_deposition.effects.library.standoff_efficiency import StandoffEfficiency
from paint_deposition.effects.library.tcp_standoff import TcpStandoff

OMEGA_M = MODEL.projection.model_plane_m
OFFSET_M = MODEL.projection.emission_offset_m
STANDOFFS_M = [0.15, 0.4]


def volume_cm3(film_um: np.ndarray) -> float:
    return float(film_um @ panel().vertex_areas_m2)


def width_m(film_um: np.ndarray) -> float:
    """Root mean square distance of the paint from the centre."""
    x, _, z = panel().vertices_m.T
    weight = film_um * panel().vertex_areas_m2
    return float(np.sqrt(weight @ (x**2 + z**2) / weight.sum()))


@pytest.mark.parametrize('exponent', [-0.5, 0.8])
@pytest.mark.parametrize('standoff_m', STANDOFFS_M)
def test_spread_changes_the_width_by_a_power_of_the_distance(exponent, standoff_m):
    plain = painted(panel(), spot(standoff_m=standoff_m)).raw_um
    spread = painted(panel(), spot(standoff_m=standoff_m), PatternSpread(exponent=exponent)).raw_um
    ratio = (standoff_m + OFFSET_M) / OMEGA_M
    assert width_m(spread) / width_m(plain) == pytest.approx(ratio**exponent, rel=1e-3)
    assert volume_cm3(spread) == pytest.approx(MODEL.planar.K1_cm3_per_s, rel=1e-4)


@pytest.mark.parametrize('standoff_m', STANDOFFS_M)
def test_efficiency_falls_with_a_power_of_the_distance(standoff_m):
    film = painted(panel(), spot(standoff_m=standoff_m), StandoffEfficiency(exponent=0.7)).raw_um
    ratio = (standoff_m + OFFSET_M) / OMEGA_M
    expected_cm3 = MODEL.planar.K1_cm3_per_s * ratio**-0.7
    assert volume_cm3(film) == pytest.approx(expected_cm3, rel=1e-4)


def test_a_wrong_tcp_is_another_distance():
    film = painted(panel(), spot(standoff_m=0.25), TcpStandoff(offset_z_m=0.02)).raw_um
    nearer = painted(panel(), spot(standoff_m=0.23)).raw_um
    np.testing.assert_allclose(film, nearer, atol=1e-12 * nearer.max())
