"""Effects of order, level and curvature: closed forms on known parts."""

import numpy as np
import pytest

from booth import MODEL, painted, panel, panel_with_screen, path_of, serpentine, spot
from paint_deposition.effects.library.convex_attraction import ConvexAttraction
from paint_deposition.effects.library.faraday_shielding import FaradayShielding
from paint_deposition.effects.library.flow_drift import MIDDLE_PASS, FlowDrift
from paint_deposition.effects.library.fog_gradient import FogGradient
from paint_deposition.effects.library.gauge_curvature_bias import GaugeCurvatureBias
from paint_deposition.effects.library.incidence_attraction import IncidenceAttraction
from paint_deposition.effects.library.occlusion import Occlusion
from paint_deposition.effects.library.overspray_fog import OversprayFog
from paint_deposition.part.points import SurfacePoints

RADIUS_M = 0.25


def make_surface(curvature_per_m: float) -> SurfacePoints:
    """A point on surface of that curvature."""
    return SurfacePoints(
        np.zeros((1, 3)), np.array([[0.0, -1.0, 0.0]]), curvature_per_m=np.array([curvature_per_m])
    )


@pytest.mark.parametrize(
    ('effect', 'convex_um', 'flat_um', 'concave_um'),
    [
        (ConvexAttraction(gain=0.2), 24.0, 20.0, 20.0),
        (FaradayShielding(shielding=0.2), 20.0, 20.0, 20.0 * np.exp(-0.2)),
    ],
)
def test_film_on_surface_of_250_mm_radius(effect, convex_um, flat_um, concave_um):
    film = np.array([20.0])
    curvatures = (-1.0 / RADIUS_M, 0.0, 1.0 / RADIUS_M)
    films = [effect.on_film(film, make_surface(curvature))[0] for curvature in curvatures]
    assert films == pytest.approx([convex_um, flat_um, concave_um])


def test_the_gauge_reads_high_on_convex_surface_whatever_the_film():
    gauge = GaugeCurvatureBias(bias_um=1.5)
    for film_um in (0.0, 40.0):
        film = np.array([film_um])
        assert gauge.on_gauge(film, make_surface(-1.0 / RADIUS_M))[0] == pytest.approx(
            film_um + 1.5
        )
        assert gauge.on_gauge(film, make_surface(1.0 / RADIUS_M))[0] == pytest.approx(
            film_um - 1.5
        )
        assert gauge.on_film(film, make_surface(1.0 / RADIUS_M))[0] == film_um


def test_fog_adds_exactly_and_only_to_a_part_that_was_sprayed():
    path = path_of(spot())
    plain = painted(panel(), path).film_um
    fog = painted(panel(), path, OversprayFog(fog_um=1.3)).film_um
    np.testing.assert_array_equal(fog, plain + 1.3)
    height = (panel().vertices_m[:, 2] + 0.5) / 1.0
    gradient = painted(panel(), path, FogGradient(fog_um=2.0)).film_um
    np.testing.assert_allclose(gradient, plain + 2.0 * (1.0 - height), rtol=1e-12)
    nothing = path.select(slice(0, 0))
    for effect in (OversprayFog(fog_um=1.3), FogGradient(fog_um=2.0)):
        assert not painted(panel(), nothing, effect).film_um.any()


def test_flow_drifts_from_pass_to_pass():
    path = path_of(serpentine((0.3, 0.1, -0.1, -0.3)))
    drifting = FlowDrift(drift_per_pass=-0.05)
    for number in range(4):
        one_pass = path.select(path.spray_pass == number)
        plain = painted(panel(), one_pass).raw_um
        film = painted(panel(), one_pass, drifting).raw_um
        np.testing.assert_allclose(film, plain * 0.95 ** (number - MIDDLE_PASS), rtol=1e-9)


@pytest.mark.parametrize('attraction', [-1.0, 0.5, 2.0])
def test_attraction_goes_with_the_incidence_of_each_ray(attraction):
    path = path_of(spot())
    plain = painted(panel(), path).raw_um
    film = painted(panel(), path, IncidenceAttraction(attraction=attraction)).raw_um
    distance_m = 0.25 + MODEL.projection.emission_offset_m
    radius2 = (panel().vertices_m[:, [0, 2]] ** 2).sum(axis=1)
    cos_incidence = distance_m / np.sqrt(distance_m**2 + radius2)
    expected = plain * (1.0 + attraction * (1.0 - cos_incidence))
    np.testing.assert_allclose(film, expected, atol=1e-11 * plain.max())


@pytest.mark.parametrize('strength', [0.4, 1.0])
def test_what_the_screen_hides_loses_its_share(strength):
    part, path = panel_with_screen(), path_of(spot())
    plain = painted(part, path).raw_um
    film = painted(part, path, Occlusion(strength=strength)).raw_um
    x, y, z = part.vertices_m.T
    # The screen 100 mm before the panel seen from the emission point 300 mm before it.
    shadow_m = 0.05 * 0.3 / 0.2
    behind, off_axis = y > -0.01, np.maximum(np.abs(x), np.abs(z))
    hidden = behind & (off_axis < shadow_m - 0.002)
    seen = ~behind | (off_axis > shadow_m + 0.002)
    assert hidden.sum() > 40
    np.testing.assert_allclose(film[hidden], (1.0 - strength) * plain[hidden], rtol=1e-9)
    np.testing.assert_allclose(film[seen], plain[seen], rtol=1e-9)
