"""The smoothed surface that passes follow, the passes, and whether the gun keeps clear."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from trimesh.creation import box

import paint_deposition as pd
from booth import panel, panel_with_screen, serpentine
from paint_deposition.errors import PaintError
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.planning import passes as gun_passes
from paint_deposition.planning.passes import PassStyle, plan_pass, plan_passes, trajectory_of
from paint_deposition.planning.planned_film import contacts
from paint_deposition.planning.sides import SurfaceMap, pass_axes
from surfaces import sheet


def test_a_plane_keeps_its_place_and_normal_to_its_edges():
    surface = sheet(lambda x, z: 0.2 * x - 0.1 * z)
    surface_map = SurfaceMap(surface, pass_axes(surface, outward=(0.0, -1.0, 0.0)), 0.1)
    u, v = (grid.ravel() for grid in np.meshgrid(*2 * [np.linspace(-0.45, 0.45, 15)]))
    places = surface_map.places_m(u, v)
    deviation = places[:, 1] - (0.2 * places[:, 0] - 0.1 * places[:, 2])
    assert np.abs(deviation).max() < 1.5e-3
    expected = np.array([0.2, -1.0, -0.1]) / np.linalg.norm([0.2, -1.0, -0.1])
    cosine = surface_map.normals(u, v) @ expected
    assert np.degrees(np.arccos(cosine.clip(-1, 1))).max() < 1.0


def test_what_is_finer_than_the_radius_is_smoothed_away_and_what_is_wider_kept():
    ripple = sheet(lambda x, z: 0.004 * np.sin(2.0 * np.pi * x / 0.06), count=121)
    bow = sheet(lambda x, z: 0.5 * x**2)
    u = np.linspace(-0.35, 0.35, 200)
    smoothed = SurfaceMap(ripple, pass_axes(ripple, outward=(0.0, -1.0, 0.0)), 0.15)
    assert np.ptp(smoothed.height_m(u, 0.0 * u)) < 0.0015
    surface_map = SurfaceMap(bow, pass_axes(bow), 0.15)
    height = surface_map.height_m(u, 0.0 * u)
    # Curved by 1/m toward the gun's far side; a Gaussian of half the radius lowers it evenly.
    assert height[0] - height[100] == pytest.approx(-0.5 * 0.35**2, rel=0.05)


def test_hidden_and_averted_surface_is_not_painted():
    front, back = sheet(lambda x, z: 0.0 * x), sheet(lambda x, z: 0.0 * x + 0.2, half_m=0.2)
    vertices_m = np.concatenate([front.vertices_m, back.vertices_m])
    faces = np.concatenate([front.faces, back.faces + len(front.vertices_m)])
    both = pd.Surface.from_triangles(vertices_m, faces, 0.1)
    surface_map = SurfaceMap(both, pass_axes(both), 0.1)
    y = both.vertices_m[:, 1]
    assert surface_map.painted[y < 0.1].all()
    assert not surface_map.painted[y > 0.1].any()


def test_ends_of_a_slanted_part_follow_the_pass_and_impossible_parts_are_refused():
    surface = sheet(lambda x, z: 0.0 * x)
    cut = surface.faces[surface.vertices_m[surface.faces].mean(axis=1) @ [1.0, 0.0, 1.0] < 0.0]
    part = pd.Surface.from_triangles(surface.vertices_m, cut, 0.05)
    surface_map = SurfaceMap(part, pass_axes(part), 0.05)
    low, high = (np.ptp(surface_map.extent_near_m(z, 0.01)) for z in (0.4, -0.3))
    assert low > high + 0.4
    surface = sheet(lambda x, z: 0.0 * x)
    with pytest.raises(PaintError, match='no surface faces the gun'):
        SurfaceMap(surface, pass_axes(surface, outward=(0.0, 1.0, 0.0)), 0.1)
    body = box()
    with pytest.raises(PaintError, match='closed'):
        pass_axes(pd.Surface.from_triangles(body.vertices, np.asarray(body.faces), 0.5))


STYLE = PassStyle(0.25, 0.3, acceleration_m_per_s2=2.0, overspray_m=0.2)
LINES_M = np.array([0.3, 0.0, -0.3])


@pytest.fixture(scope='module')
def bowed():
    surface = sheet(lambda x, z: 0.3 * x**2 + 0.2 * z**2)
    return SurfaceMap(surface, pass_axes(surface), 0.1)


@pytest.fixture(scope='module')
def motion(bowed):
    return trajectory_of(plan_passes(bowed, LINES_M, STYLE), 'part')


def test_pass_keeps_standoff_and_is_square_to_the_surface(bowed):
    planned = plan_pass(bowed, 0.1, STYLE)
    tool_z = planned.rotations[:, :, 2]
    on_surface = planned.positions_m + STYLE.standoff_m * tool_z
    u, v, height = ((on_surface - bowed.origin_m) @ bowed.axes.T).T
    np.testing.assert_allclose(v, 0.1, atol=1e-9)
    np.testing.assert_allclose(height, bowed.height_m(u, v), atol=1e-9)
    np.testing.assert_allclose(tool_z, -bowed.normals(u, v), atol=1e-9)
    identity = planned.rotations.transpose(0, 2, 1) @ planned.rotations
    np.testing.assert_allclose(identity, np.broadcast_to(np.eye(3), identity.shape), atol=1e-9)
    assert np.allclose(np.linalg.det(planned.rotations), 1.0)


def test_gun_is_on_from_before_the_part_to_behind_it(bowed):
    planned = plan_pass(bowed, 0.0, STYLE)
    path, _ = spray_path(trajectory_of((planned,)))
    # Where the gun's axis meets the surface: the TCP leans out over the bow.
    aimed_at = path.position_m + STYLE.standoff_m * path.rotation[:, :, 2]
    on = ((aimed_at[path.flow > 0.0] - bowed.origin_m) @ bowed.axes.T)[:, 0]
    assert on.min() == pytest.approx(-0.5 - STYLE.overspray_m, abs=0.02)
    assert on.max() == pytest.approx(0.5 + STYLE.overspray_m, abs=0.02)


def test_speed_is_even_while_spraying_and_acceleration_kept(motion):
    seconds = np.diff(motion.stamps_ns) * 1e-9
    speed = np.linalg.norm(np.diff(motion.positions_m, axis=0), axis=1) / seconds
    assert speed.max() < STYLE.speed_m_per_s * 1.001
    steps = np.abs(np.diff(speed)) / seconds[1:]
    assert np.quantile(steps, 0.999) < STYLE.acceleration_m_per_s2 * 1.02
    path, _ = spray_path(motion)
    on = path.speed_m_per_s[path.flow > 0.0]
    np.testing.assert_allclose(on, STYLE.speed_m_per_s, rtol=2e-3)
    assert np.median(seconds) == pytest.approx(0.004, abs=1e-5)
    assert seconds.min() > 0.0


def test_serpentine_alternates_and_keeps_the_tool_as_it_is(bowed, motion):
    def by_pass(motion, column: str) -> list[np.ndarray]:
        """The mean of a column over each pass."""
        path, _ = spray_path(motion)
        on = path.select(path.flow > 0.0)
        return [getattr(on, column)[on.spray_pass == k].mean(axis=0) for k in range(3)]

    ways = by_pass(motion, 'velocity_m_per_s')
    assert ways[0] @ ways[1] < 0.0 < ways[0] @ ways[2]
    tool_x = [axes[:, 0] for axes in by_pass(motion, 'rotation')]
    assert tool_x[0] @ tool_x[1] > 0.9
    one_way = PassStyle(0.25, 0.3, overspray_m=0.2, one_way=True)
    ways = by_pass(trajectory_of(plan_passes(bowed, LINES_M, one_way)), 'velocity_m_per_s')
    assert min(ways[0] @ ways[1], ways[0] @ ways[2]) > 0.0
    assert motion.trigger_flow.tolist() == [1.0, 0.0] * 3


def test_travel_direction_in_the_tool_frame_is_the_angle_asked_for(bowed):
    style = PassStyle(0.25, 0.3, travel_rad=0.7)
    planned = plan_pass(bowed, 0.0, style)
    ahead = np.gradient(planned.positions_m, axis=0)[100]
    ahead /= np.linalg.norm(ahead)
    x, y, _ = planned.rotations[100].T @ ahead
    assert np.arctan2(y, x) == pytest.approx(0.7, abs=1e-3)


def test_moves_of_the_robot_follow_the_same_way(bowed):
    passes = plan_passes(bowed, LINES_M, STYLE)
    moves = gun_passes.planned_moves(passes)
    assert not moves[0].spraying
    switches = np.diff([move.spraying for move in moves])
    assert np.count_nonzero(switches) == 2 * len(passes)
    every = np.concatenate([planned.positions_m for planned in passes])
    for move in moves:
        assert np.linalg.norm(every - move.position_m, axis=1).min() < 0.006
        assert np.linalg.norm(move.quaternion_xyzw) == pytest.approx(1.0)
    start = Rotation.from_quat(moves[0].quaternion_xyzw).as_matrix()
    np.testing.assert_allclose(start, passes[0].rotations[0], atol=1e-9)


# The gun runs along x at 0.25 m before the panel; the screen stands 0.1 m before it at |x| < 0.05.
SPEED, HALF = 0.3, 0.45
MOTION = serpentine(speed_m_per_s=SPEED, half_width_m=HALF)


def test_a_screen_before_the_gun_is_met_while_it_passes_and_told_from_one_in_it():
    assert contacts(panel(), MOTION, pd.GunEnvelope()) == ()
    (contact,) = contacts(panel_with_screen(), MOTION, pd.GunEnvelope(radius_m=0.04, before_m=0.2))
    assert not contact.by_gun
    # By 200 mm of cylinder over the 150 mm from the TCP to the screen; aside no further than 40.
    assert contact.depth_m == pytest.approx(0.04, abs=0.01)
    assert contact.begin_s == pytest.approx((HALF - 0.05 - 0.04) / SPEED, abs=0.05)
    assert contact.end_s == pytest.approx((HALF + 0.05 + 0.04) / SPEED, abs=0.05)
    assert abs(contact.place_m[1] + 0.1) < 1e-9
    through = replace(MOTION, positions_m=MOTION.positions_m + np.array([0.0, 0.2, 0.0]))
    thin = pd.GunEnvelope(radius_m=0.04, before_m=0.0)
    (contact,) = contacts(panel_with_screen(), through, thin)
    assert contact.by_gun
    assert 'touches' in str(contact)


@pytest.mark.slow
def test_a_plan_on_which_the_gun_touches_the_part_is_refused_and_one_too_near_says_so(tmp_path):
    """The gun's body reaches back from the TCP, 30 mm from the panel: the screen is in its way."""
    wanted = {'speed_m_per_s': 0.3, 'smoothing_radius_m': 0.3}
    touches = r'the gun touches the part at .* give a greater standoff'
    with pytest.raises(PaintError, match=touches):
        pd.plan(panel_with_screen(), standoff_m=0.03, **wanted)
    reaching = pd.GunEnvelope(radius_m=0.04, before_m=0.2)
    kept = pd.plan(panel_with_screen(), envelope=reaching, **wanted)
    near, *_ = [line for line in kept.warnings if 'the part is too near before the gun' in line]
    pd.write(kept, tmp_path)
    assert f'! WARNING: {near}' in (tmp_path / 'passes.mod').read_text()
