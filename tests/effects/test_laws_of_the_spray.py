"""Laws of the rays and of where they land, in closed form on a flat panel."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import booth
import paint_deposition as pd
from paint_deposition.effects.catalogue import EFFECTS

OFFSET_M = booth.MODEL.projection.emission_offset_m
POINTS = booth.panel().points()


def rolled(trajectory: pd.Trajectory, angle_rad: float) -> pd.Trajectory:
    """The same motion with the gun turned about its axis."""
    turned = Rotation.from_quat(booth.LOOKING_ALONG_Y) * Rotation.from_euler('z', angle_rad)
    return replace(trajectory, quaternions_xyzw=np.tile(turned.as_quat(), (len(trajectory), 1)))


def distance_ratio(standoff_m: float) -> float:
    """Distance from the emission point to the panel over that of the model plane."""
    return (standoff_m + OFFSET_M) / booth.MODEL.projection.model_plane_m


def moved_by_m(trajectory: pd.Trajectory, effect) -> np.ndarray:
    """How the spot's centroid moves: right and down [m]."""
    before, after = (
        booth.centroid_m(booth.painted(booth.panel(), trajectory, *effects).raw_um, POINTS)
        for effects in ((), (effect,))
    )
    return (after - before)[[0, 2]] * [1.0, -1.0]


@pytest.mark.parametrize('standoff_m', [0.2, 0.35])
@pytest.mark.parametrize('roll_rad', [0.0, 1.0])
def test_drift_grows_with_the_distance_and_does_not_turn_with_the_gun(standoff_m, roll_rad):
    motion = rolled(booth.spot(standoff_m=standoff_m), roll_rad)
    moved = moved_by_m(motion, EFFECTS['air_drift'](shift_down_m=0.02, shift_across_m=-0.01))
    expected = distance_ratio(standoff_m) * np.array([-0.01, 0.02])
    np.testing.assert_allclose(moved, expected, atol=2e-5)


@pytest.mark.parametrize('roll_rad', [0.0, 0.5 * np.pi, np.pi])
def test_an_offset_turns_with_the_gun(roll_rad):
    offset = EFFECTS['tcp_offset'](offset_x_m=0.01, offset_y_m=0.004)
    # Right-handed about the view of the gun: clockwise with x to the right and y down.
    cos, sin = np.cos(roll_rad), np.sin(roll_rad)
    expected = [0.01 * cos - 0.004 * sin, 0.01 * sin + 0.004 * cos]
    np.testing.assert_allclose(
        moved_by_m(rolled(booth.spot(), roll_rad), offset), expected, atol=1e-5
    )


@pytest.mark.parametrize('standoff_m', [0.2, 0.3])
@pytest.mark.parametrize(('axis', 'place'), [('y', 0), ('x', 2)])
def test_a_tilt_moves_the_spot_by_the_standoff_times_its_tangent(standoff_m, axis, place):
    # The axis pierces the panel there; the centroid of an inclined spot lies beside its axis.
    planar = booth.MODEL.planar.model_copy(
        update={'K3': 0.0, 'r_m': 0.0, 'sigma1_m': 0.01, 'sigma2_m': 0.01}
    )
    narrow, fine = booth.MODEL.model_copy(update={'planar': planar}), booth.panel(0.1, 0.004)
    tilt = EFFECTS['tcp_tilt'](**{f'tilt_{axis}_rad': 0.08})
    film_um = booth.painted(fine, booth.spot(standoff_m=standoff_m), tilt, model=narrow).raw_um
    moved_m = booth.centroid_m(film_um, fine.points())[place]
    assert moved_m == pytest.approx(standoff_m * np.tan(0.08), rel=0.01)


def test_misalignment_is_the_part_moved():
    drawn = booth.panel(0.4, 0.04)
    fault = EFFECTS['part_misalignment'](
        shift_down_m=0.03, shift_across_m=-0.02, shift_deep_m=0.01, yaw_rad=0.09
    )
    seen_by_gun = Rotation.from_rotvec([0.0, -0.09, 0.0])  # about the outward normal, -y
    hung = pd.Surface(
        seen_by_gun.apply(drawn.vertices_m) + np.array([-0.02, 0.01, -0.03]), drawn.faces,
        seen_by_gun.apply(drawn.normals), drawn.vertex_areas_m2, drawn.down,
    )  # fmt: skip
    motion = booth.serpentine((0.1, -0.1))
    expected = booth.painted(hung, motion).raw_um
    film = booth.painted(drawn, motion, fault).raw_um
    np.testing.assert_allclose(film, expected, atol=1e-10 * expected.max())


@pytest.mark.slow
@pytest.mark.parametrize('standoff_m', [0.15, 0.4])
def test_width_and_volume_go_with_powers_of_the_distance(standoff_m):
    motion, ratio = booth.spot(standoff_m=standoff_m), distance_ratio(standoff_m)
    plain = booth.spread_m(booth.painted(booth.panel(), motion).raw_um, POINTS)
    for exponent in (-0.5, 0.8):
        spread = booth.painted(
            booth.panel(), motion, EFFECTS['pattern_spread'](exponent=exponent)
        ).raw_um
        assert booth.spread_m(spread, POINTS) / plain == pytest.approx(ratio**exponent, rel=1e-3)
        volume = booth.volume_cm3(spread, POINTS)
        assert volume == pytest.approx(booth.MODEL.planar.K1_cm3_per_s, rel=1e-4)
    lossy = booth.painted(
        booth.panel(), motion, EFFECTS['standoff_efficiency'](exponent=0.7)
    ).raw_um
    expected = booth.MODEL.planar.K1_cm3_per_s * ratio**-0.7
    assert booth.volume_cm3(lossy, POINTS) == pytest.approx(expected, rel=1e-4)


def test_a_wrong_tcp_is_another_distance():
    wrong = EFFECTS['tcp_standoff'](offset_z_m=0.02)
    film = booth.painted(booth.panel(), booth.spot(standoff_m=0.25), wrong).raw_um
    nearer = booth.painted(booth.panel(), booth.spot(standoff_m=0.23)).raw_um
    np.testing.assert_allclose(film, nearer, atol=1e-12 * nearer.max())


@pytest.mark.parametrize('attraction', [-1.0, 2.0])
def test_attraction_goes_with_the_incidence_of_each_ray(attraction):
    effect = EFFECTS['incidence_attraction'](attraction=attraction)
    plain, film = (
        booth.painted(booth.panel(), booth.spot(), *effects).raw_um for effects in ((), (effect,))
    )
    distance_m = 0.25 + OFFSET_M
    radius2 = (booth.panel().vertices_m[:, [0, 2]] ** 2).sum(axis=1)
    cos_incidence = distance_m / np.sqrt(distance_m**2 + radius2)
    expected = plain * (1.0 + attraction * (1.0 - cos_incidence))
    np.testing.assert_allclose(film, expected, atol=1e-11 * plain.max())


@pytest.mark.parametrize('strength', [0.4, 1.0])
def test_what_the_screen_hides_loses_its_share(strength):
    part, path = booth.panel_with_screen(), booth.path_of(booth.spot())
    plain = booth.painted(part, path).raw_um
    film = booth.painted(part, path, EFFECTS['occlusion'](strength=strength)).raw_um
    x, y, z = part.vertices_m.T
    # The screen 100 mm before the panel seen from the emission point 300 mm before it.
    shadow_m = 0.05 * 0.3 / 0.2
    behind, off_axis = y > -0.01, np.maximum(np.abs(x), np.abs(z))
    hidden = behind & (off_axis < shadow_m - 0.002)
    seen = ~behind | (off_axis > shadow_m + 0.002)
    assert hidden.sum() > 40
    np.testing.assert_allclose(film[hidden], (1.0 - strength) * plain[hidden], rtol=1e-9)
    np.testing.assert_allclose(film[seen], plain[seen], rtol=1e-9)
