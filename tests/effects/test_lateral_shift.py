"""Effects that move the pattern aside: how far, and with what the shift turns."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from booth import LOOKING_ALONG_Y, MODEL, painted, panel, serpentine, spot
from paint_deposition.effects.library.air_drift import AirDrift
from paint_deposition.effects.library.part_misalignment import PartMisalignment
from paint_deposition.effects.library.sag import Sag
from paint_deposition.effects.library.tcp_offset import TcpOffset
from paint_deposition.effects.library.tcp_tilt import TcpTilt
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.part.points import SurfacePoints
from paint_deposition.part.surface import Surface

OMEGA_M = MODEL.projection.model_plane_m
OFFSET_M = MODEL.projection.emission_offset_m


def rolled(trajectory: Trajectory, angle_rad: float) -> Trajectory:
    """The same motion with the gun turned about its axis."""
    turned = Rotation.from_quat(LOOKING_ALONG_Y) * Rotation.from_euler('z', angle_rad)
    return replace(trajectory, quaternions_xyzw=np.tile(turned.as_quat(), (len(trajectory), 1)))


def centroid_m(film_um: np.ndarray, points: SurfacePoints) -> np.ndarray:
    weight = film_um * points.area_m2
    return weight @ points.positions_m / weight.sum()


def moved_by_m(trajectory: Trajectory, effect) -> np.ndarray:
    """How the spot's centroid moves: right and down [m]."""
    points = panel().points()
    before, after = (
        centroid_m(painted(panel(), trajectory, *effects).raw_um, points)
        for effects in ((), (effect,))
    )
    return (after - before)[[0, 2]] * [1.0, -1.0]


@pytest.mark.parametrize('standoff_m', [0.2, 0.25, 0.35])
@pytest.mark.parametrize('roll_rad', [0.0, 1.0, np.pi])
def test_drift_grows_with_the_distance_and_does_not_turn_with_the_gun(standoff_m, roll_rad):
    motion = rolled(spot(standoff_m=standoff_m), roll_rad)
    moved = moved_by_m(motion, AirDrift(shift_down_m=0.02, shift_across_m=-0.01))
    longer = (standoff_m + OFFSET_M) / OMEGA_M
    np.testing.assert_allclose(moved, [-0.01 * longer, 0.02 * longer], atol=2e-5)


@pytest.mark.parametrize('roll_rad', [0.0, 0.5 * np.pi, np.pi])
def test_an_offset_turns_with_the_gun(roll_rad):
    moved = moved_by_m(rolled(spot(), roll_rad), TcpOffset(offset_x_m=0.01, offset_y_m=0.004))
    # Right-handed about the view of the gun: clockwise with x to the right and y down.
    cos, sin = np.cos(roll_rad), np.sin(roll_rad)
    np.testing.assert_allclose(
        moved, [0.01 * cos - 0.004 * sin, 0.01 * sin + 0.004 * cos], atol=1e-5
    )


@pytest.mark.parametrize('standoff_m', [0.2, 0.3])
def test_a_tilt_moves_the_spot_by_the_standoff_times_its_tangent(standoff_m):
    # The axis pierces the panel there; the centroid of an inclined spot lies beside its axis.
    motion = spot(standoff_m=standoff_m)
    narrow = MODEL.model_copy(
        update={
            'planar': MODEL.planar.model_copy(
                update={'K3': 0.0, 'r_m': 0.0, 'sigma1_m': 0.01, 'sigma2_m': 0.01}
            )
        }
    )
    fine = panel(0.1, 0.004)
    film = painted(fine, motion, TcpTilt(tilt_y_rad=0.08), model=narrow).raw_um
    x_m = centroid_m(film, fine.points())[0]
    assert x_m == pytest.approx(standoff_m * np.tan(0.08), rel=0.01)
    film = painted(fine, motion, TcpTilt(tilt_x_rad=0.08), model=narrow).raw_um
    assert -centroid_m(film, fine.points())[2] == pytest.approx(-standoff_m * np.tan(0.08), 0.01)


def test_misalignment_is_the_part_moved():
    drawn = panel(0.4, 0.04)
    fault = PartMisalignment(
        shift_down_m=0.03, shift_across_m=-0.02, shift_deep_m=0.01, yaw_rad=0.09
    )
    seen_by_gun = Rotation.from_rotvec([0.0, -0.09, 0.0])  # about the outward normal, -y
    hung = Surface(
        seen_by_gun.apply(drawn.vertices_m) + np.array([-0.02, 0.01, -0.03]), drawn.faces,
        seen_by_gun.apply(drawn.normals), drawn.vertex_areas_m2, drawn.down,
    )  # fmt: skip
    motion = serpentine((0.1, -0.1))
    expected = painted(hung, motion).raw_um
    film = painted(drawn, motion, fault).raw_um
    np.testing.assert_allclose(film, expected, atol=1e-10 * expected.max())


def test_sag_follows_the_closed_form_of_a_thin_film_on_a_wall():
    points = panel(0.5, 0.01).points()
    z = points.positions_m[:, 2]
    film = 20.0 + 5.0 * np.sin(2.0 * np.pi * z / 0.5)
    sagged = Sag(run_m=0.002).on_film(film, points)
    gradient_down = -5.0 * np.cos(2.0 * np.pi * z / 0.5) * 2.0 * np.pi / 0.5
    expected = film - 0.002 * 3.0 * (film / 20.0) ** 2 * gradient_down
    inside = np.abs(z) < 0.48  # at the ends the slope is one-sided
    moved_um = np.abs(expected - film).max()
    np.testing.assert_allclose(sagged[inside], expected[inside], atol=0.04 * moved_um)
