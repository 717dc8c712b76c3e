"""Laws of motion, rays, time and film in closed form on known parts."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import booth
import paint_deposition as pd
from booth import MODEL, painted, panel, path_of, serpentine, spot
from paint_deposition.effects.base import PathContext
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.effects.library.flow_drift import MIDDLE_PASS
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.part.points import SurfacePoints

DOWN, OUTWARD = np.array([0.0, 0.0, -1.0]), np.array([0.0, -1.0, 0.0])
CONTEXT = PathContext(MODEL.projection, DOWN, OUTWARD, np.zeros(3))
RADIUS_M = 0.25


def trigger_lag(rise_s: float = 0.0, fall_s: float = 0.0):
    return EFFECTS['trigger_lag'](rise_s=rise_s, fall_s=fall_s)


def after(effect, path: SprayPath) -> SprayPath:
    return effect.on_path(path, CONTEXT)


def test_edge_build_decays_from_the_edge_on_all_sides_alike():
    points = panel().points()
    edge_build = EFFECTS['edge_build'](gain=0.3, length_m=0.02)
    film = edge_build.on_film(np.full(len(points), 10.0), points)
    x, _, z = np.abs(points.positions_m).T
    expected = 10.0 * (1.0 + 0.3 * np.exp(-(0.5 - np.maximum(x, z)) / 0.02))
    np.testing.assert_allclose(film, expected, rtol=1e-9)


def test_corner_slowdown_acts_at_turns_and_ends_and_nowhere_else():
    path = path_of(serpentine((0.2, -0.2), half_width_m=0.45))
    effect = EFFECTS['corner_slowdown'](gain=0.4, length_m=0.03)
    slower = after(effect, path).dwell_s / path.dwell_s - 1.0
    at_turn = np.minimum(path.from_turn_m, path.to_turn_m)
    np.testing.assert_allclose(slower, 0.4 * np.exp(-at_turn / 0.03), atol=1e-14)
    x, _, z = path.position_m.T
    on_passes = np.abs(np.abs(z) - 0.2) < 1e-9
    assert slower[on_passes & (np.abs(x) > 0.44)].min() > 0.15
    assert slower[on_passes & (np.abs(x) < 0.15)].max() < 1e-4


def lagged_flow(trajectory, rise_s: float, fall_s: float, times_s: np.ndarray) -> np.ndarray:
    """Tau dF/dt = C - F, integrated numerically from change to change."""
    changes = (trajectory.trigger_stamps_ns - trajectory.stamps_ns[0]) * 1e-9
    edges = np.append(changes, times_s[-1] + 1.0)
    flow, level = np.zeros(len(times_s)), 0.0
    for begin, end, command in zip(changes, edges[1:], trajectory.trigger_flow, strict=True):
        tau = rise_s if command > 0.0 else fall_s
        inside = (times_s >= begin) & (times_s < end)
        solution = solve_ivp(
            lambda _, f, c=command, tau=tau: (c - f) / tau, (begin, end), [level],
            dense_output=True, rtol=1e-10, atol=1e-12,
        )  # fmt: skip
        flow[inside] = solution.sol(times_s[inside])[0]
        level = solution.y[0, -1]
    return flow


def blinking():
    """A gun that closes for 20 ms: what is left of one opening helps the next."""
    trajectory = serpentine((0.0,), opens_at_m=0.25)
    blink_ns = trajectory.trigger_stamps_ns[0] + np.array([0, 400, 420, 900]) * 1_000_000
    return replace(trajectory, trigger_stamps_ns=blink_ns, trigger_flow=np.array([1.0, 0, 1, 0]))


@pytest.mark.parametrize(
    ('trajectory', 'fall_s', 'tolerance'),
    [*((serpentine((0.1, -0.1), flow=flow), 0.03, 2e-5) for flow in (1.0, 0.5)),
     (blinking(), 0.05, 5e-4)],
    ids=['full flow', 'half flow', 'blinking'],
)  # fmt: skip
def test_trigger_lag_solves_its_equation(trajectory, fall_s, tolerance):
    path = spray_path(trajectory, max_step_m=2e-4)[0]
    lagged = after(trigger_lag(rise_s=0.05, fall_s=fall_s), path)
    times = (path.stamp_ns - trajectory.stamps_ns[0]) * 1e-9
    expected = lagged_flow(trajectory, 0.05, fall_s, times)
    np.testing.assert_allclose(lagged.flow, expected, atol=tolerance)


@pytest.mark.parametrize('step_m', [8e-3, 1e-3])
def test_trigger_lag_takes_tau_on_and_gives_tau_off_however_coarse_the_steps(step_m):
    path = spray_path(serpentine((0.0,)), max_step_m=step_m)[0]
    for rise_s, fall_s in ((0.01, 0.0), (0.0, 0.01), (0.02, 0.02)):
        lagged_s = after(trigger_lag(rise_s, fall_s), path).spraying_time_s
        assert lagged_s == pytest.approx(path.spraying_time_s - rise_s + fall_s)


@pytest.mark.parametrize(('lag_s', 'flow'), [(-0.05, 1.0), (-0.007, 0.6), (0.04, 1.0)])
def test_pose_lag_is_a_trigger_recorded_later(lag_s, flow):
    trajectory = serpentine((0.1, -0.1), flow=flow)
    shifted_ns = trajectory.trigger_stamps_ns + round(lag_s * 1e9)
    expected = painted(panel(), replace(trajectory, trigger_stamps_ns=shifted_ns)).raw_um
    film = painted(panel(), trajectory, EFFECTS['pose_lag'](lag_s=lag_s)).raw_um
    np.testing.assert_allclose(film, expected, atol=2e-3 * expected.max())


def test_gun_wake_is_the_pass_moved_back_and_a_wrong_tcp_another_distance():
    trajectory = serpentine((0.0,), speed_m_per_s=0.35)
    moved = replace(trajectory, positions_m=trajectory.positions_m - [0.02 * 0.35, 0.0, 0.0])
    film = painted(panel(), trajectory, EFFECTS['gun_wake'](lag_s=0.02)).raw_um
    expected = painted(panel(), moved).raw_um
    np.testing.assert_allclose(film, expected, atol=1e-9 * expected.max())
    wrong = EFFECTS['tcp_standoff'](offset_z_m=0.02)
    film = painted(panel(), spot(standoff_m=0.25), wrong).raw_um
    nearer = painted(panel(), spot(standoff_m=0.23)).raw_um
    np.testing.assert_allclose(film, nearer, atol=1e-12 * nearer.max())


def test_flow_drifts_from_pass_to_pass():
    path = path_of(serpentine((0.3, 0.1, -0.1, -0.3)))
    drifting = EFFECTS['flow_drift'](drift_per_pass=-0.05)
    for number in range(4):
        one_pass = path.select(path.spray_pass == number)
        plain, film = (painted(panel(), one_pass, *e).raw_um for e in ((), (drifting,)))
        np.testing.assert_allclose(film, plain * 0.95 ** (number - MIDDLE_PASS), rtol=1e-9)
    # A pass by itself, as of a recommendation, has no number.
    alone = path.with_(time_s=np.full(len(path), np.nan))
    assert np.array_equal(after(drifting, alone).flow, path.flow)


@pytest.mark.parametrize('lag', [trigger_lag(0.05, 0.05), EFFECTS['pose_lag'](lag_s=0.02)])
def test_what_flows_behind_a_closing_has_drifted_like_the_pass(lag):
    path = path_of(serpentine((0.1, -0.1)))
    drifts = EFFECTS['flow_drift'](drift_per_pass=0.2)
    expected = after(drifts, after(lag, path)).flow
    np.testing.assert_allclose(after(lag, after(drifts, path)).flow, expected, rtol=1e-12)


@pytest.mark.parametrize(
    ('name', 'values', 'convex_um', 'flat_um', 'concave_um'),
    [
        ('convex_attraction', {'gain': 0.2}, 24.0, 20.0, 20.0),
        ('faraday_shielding', {'shielding': 0.2}, 20.0, 20.0, 20.0 * np.exp(-0.2)),
        # The gauge reads high on convex surface whatever the film, which stays as it is.
        ('gauge_curvature_bias', {'bias_um': 1.5}, 21.5, 20.0, 18.5),
    ],
)
def test_film_on_surface_of_250_mm_radius(name, values, convex_um, flat_um, concave_um):
    effect, found = EFFECTS[name](**values), []
    for curvature in (-1.0 / RADIUS_M, 0.0, 1.0 / RADIUS_M):
        place, normal = np.array([[0.0, 0.0, 0.0], [0.0, -1.0, 0.0]])[:, np.newaxis]
        point = SurfacePoints(place, normal, curvature_per_m=np.array([curvature]))
        film_um = effect.on_film(np.array([20.0]), point)
        found += effect.on_gauge(film_um, point).tolist()
        if name == 'gauge_curvature_bias':
            assert film_um == 20.0
            assert effect.on_gauge(np.zeros(1), point) == pytest.approx(found[-1] - 20.0)
    assert found == pytest.approx([convex_um, flat_um, concave_um])


def test_a_gauge_reads_its_gain_more_and_its_zero_higher_also_on_bare_metal():
    film_um, points = np.array([0.0, 10.0, 40.0]), panel().points()
    read = EFFECTS['gauge_zero'](offset_um=0.8).on_gauge(film_um, points)
    np.testing.assert_array_equal(read, film_um + 0.8)
    read = EFFECTS['gauge_gain'](gain=0.02).on_gauge(film_um, points)
    np.testing.assert_array_equal(read, 1.02 * film_um)


def test_fog_adds_exactly_and_only_to_a_part_that_was_sprayed():
    path = path_of(spot())
    plain = painted(panel(), path).film_um
    even, gradient = EFFECTS['overspray_fog'](fog_um=1.3), EFFECTS['fog_gradient'](fog_um=2.0)
    np.testing.assert_array_equal(painted(panel(), path, even).film_um, plain + 1.3)
    height = panel().vertices_m[:, 2] + 0.5
    fallen = painted(panel(), path, gradient).film_um
    np.testing.assert_allclose(fallen, plain + 2.0 * (1.0 - height), rtol=1e-12)
    for effect in (even, gradient):
        assert not painted(panel(), path.select(slice(0, 0)), effect).film_um.any()


def test_sag_follows_the_closed_form_of_a_thin_film_on_a_wall():
    points = panel(0.5, 0.01).points()
    z = points.positions_m[:, 2]
    film = 20.0 + 5.0 * np.sin(2.0 * np.pi * z / 0.5)
    sagged = EFFECTS['sag'](run_m=0.002).on_film(film, points)
    gradient_down = -5.0 * np.cos(2.0 * np.pi * z / 0.5) * 2.0 * np.pi / 0.5
    expected = film - 0.002 * 3.0 * (film / 20.0) ** 2 * gradient_down
    inside = np.abs(z) < 0.48  # at the ends the slope is one-sided
    moved_um = np.abs(expected - film).max()
    np.testing.assert_allclose(sagged[inside], expected[inside], atol=0.04 * moved_um)


OFFSET_M = MODEL.projection.emission_offset_m
POINTS = panel().points()


def rolled(trajectory: pd.Trajectory, angle_rad: float) -> pd.Trajectory:
    """The same motion with the gun turned about its axis."""
    turned = Rotation.from_quat(booth.LOOKING_ALONG_Y) * Rotation.from_euler('z', angle_rad)
    return replace(trajectory, quaternions_xyzw=np.tile(turned.as_quat(), (len(trajectory), 1)))


def distance_ratio(standoff_m: float) -> float:
    """Distance from the emission point to the panel over that of the model plane."""
    return (standoff_m + OFFSET_M) / MODEL.projection.model_plane_m


def moved_by_m(trajectory: pd.Trajectory, effect) -> np.ndarray:
    """How the spot's centroid moves: right and down [m]."""
    films = (painted(panel(), trajectory, *effects).raw_um for effects in ((), (effect,)))
    before, after = (booth.centroid_m(film_um, POINTS) for film_um in films)
    return (after - before)[[0, 2]] * [1.0, -1.0]


@pytest.mark.parametrize('standoff_m', [0.2, 0.35])
@pytest.mark.parametrize('roll_rad', [0.0, 1.0])
def test_drift_grows_with_the_distance_and_does_not_turn_with_the_gun(standoff_m, roll_rad):
    motion = rolled(spot(standoff_m=standoff_m), roll_rad)
    moved = moved_by_m(motion, EFFECTS['air_drift'](shift_down_m=0.02, shift_across_m=-0.01))
    expected = distance_ratio(standoff_m) * np.array([-0.01, 0.02])
    np.testing.assert_allclose(moved, expected, atol=2e-5)


@pytest.mark.parametrize(('z_m', 'shift_m'), [(0.1, 0.01), (0.0, 0.02), (-0.1, 0.03), (0.25, 0.0)])
def test_a_draught_grows_toward_the_floor_and_never_blows_up(z_m, shift_m):
    drift = EFFECTS['air_drift'](shift_down_m=0.02, gradient_down_m_per_m=0.1)
    expected = distance_ratio(booth.STANDOFF_M) * np.array([0.0, shift_m])
    np.testing.assert_allclose(moved_by_m(spot(z_m=z_m), drift), expected, atol=2e-5)


@pytest.mark.parametrize('roll_rad', [0.0, 0.5 * np.pi, np.pi])
def test_an_offset_turns_with_the_gun(roll_rad):
    offset = EFFECTS['tcp_offset'](offset_x_m=0.01, offset_y_m=0.004)
    # Right-handed about the view of the gun: clockwise with x to the right and y down.
    cos, sin = np.cos(roll_rad), np.sin(roll_rad)
    expected = [0.01 * cos - 0.004 * sin, 0.01 * sin + 0.004 * cos]
    moved_m = moved_by_m(rolled(spot(), roll_rad), offset)
    np.testing.assert_allclose(moved_m, expected, atol=1e-5)


@pytest.mark.parametrize('standoff_m', [0.2, 0.3])
@pytest.mark.parametrize(('axis', 'place'), [('y', 0), ('x', 2)])
def test_a_tilt_moves_the_spot_by_the_standoff_times_its_tangent(standoff_m, axis, place):
    # The axis pierces the panel there; the centroid of an inclined spot lies beside its axis.
    spot_m = {'K3': 0.0, 'r_m': 0.0, 'sigma1_m': 0.01, 'sigma2_m': 0.01}
    narrow, fine = MODEL.with_patterns([MODEL.planar.model_copy(update=spot_m)]), panel(0.1, 0.004)
    tilt = EFFECTS['tcp_tilt'](**{f'tilt_{axis}_rad': 0.08})
    film_um = painted(fine, spot(standoff_m=standoff_m), tilt, model=narrow).raw_um
    moved_m = booth.centroid_m(film_um, fine.points())[place]
    assert moved_m == pytest.approx(standoff_m * np.tan(0.08), rel=0.01)


def test_misalignment_is_the_part_moved():
    drawn = panel(0.4, 0.04)
    shift = {'shift_down_m': 0.03, 'shift_across_m': -0.02, 'shift_deep_m': 0.01}
    fault = EFFECTS['part_misalignment'](**shift, yaw_rad=0.09)
    seen_by_gun = Rotation.from_rotvec([0.0, -0.09, 0.0])  # about the outward normal, -y
    hung = pd.Surface(
        seen_by_gun.apply(drawn.vertices_m) + np.array([-0.02, 0.01, -0.03]), drawn.faces,
        seen_by_gun.apply(drawn.normals), drawn.vertex_areas_m2, drawn.down,
    )  # fmt: skip
    motion = serpentine((0.1, -0.1))
    expected = painted(hung, motion).raw_um
    film = painted(drawn, motion, fault).raw_um
    np.testing.assert_allclose(film, expected, atol=1e-10 * expected.max())


@pytest.mark.slow
@pytest.mark.parametrize('standoff_m', [0.15, 0.4])
def test_width_and_volume_go_with_powers_of_the_distance(standoff_m):
    motion, ratio = spot(standoff_m=standoff_m), distance_ratio(standoff_m)

    def film_um(*effects) -> np.ndarray:
        return painted(panel(), motion, *effects).raw_um

    plain = booth.spread_m(film_um(), POINTS)
    for exponent in (-0.5, 0.8):
        spread = film_um(EFFECTS['pattern_spread'](exponent=exponent))
        assert booth.spread_m(spread, POINTS) / plain == pytest.approx(ratio**exponent, rel=1e-3)
        volume = booth.volume_cm3(spread, POINTS)
        assert volume == pytest.approx(MODEL.planar.K1_cm3_per_s, rel=1e-4)
    lossy = film_um(EFFECTS['standoff_efficiency'](exponent=0.7))
    expected = MODEL.planar.K1_cm3_per_s * ratio**-0.7
    assert booth.volume_cm3(lossy, POINTS) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize('attraction', [-1.0, 2.0])
def test_attraction_goes_with_the_incidence_of_each_ray(attraction):
    effect = EFFECTS['incidence_attraction'](attraction=attraction)
    plain, film = (painted(panel(), spot(), *effects).raw_um for effects in ((), (effect,)))
    distance_m = 0.25 + OFFSET_M
    radius2 = (panel().vertices_m[:, [0, 2]] ** 2).sum(axis=1)
    cos_incidence = distance_m / np.sqrt(distance_m**2 + radius2)
    expected = plain * (1.0 + attraction * (1.0 - cos_incidence))
    np.testing.assert_allclose(film, expected, atol=1e-11 * plain.max())


@pytest.mark.parametrize('strength', [0.4, 1.0])
def test_what_the_screen_hides_loses_its_share(strength):
    part, path = booth.panel_with_screen(), path_of(spot())
    plain = painted(part, path).raw_um
    film = painted(part, path, EFFECTS['occlusion'](strength=strength)).raw_um
    x, y, z = part.vertices_m.T
    # The screen 100 mm before the panel seen from the emission point 300 mm before it.
    shadow_m = 0.05 * 0.3 / 0.2
    behind, off_axis = y > -0.01, np.maximum(np.abs(x), np.abs(z))
    hidden = behind & (off_axis < shadow_m - 0.002)
    seen = ~behind | (off_axis > shadow_m + 0.002)
    assert hidden.sum() > 40
    np.testing.assert_allclose(film[hidden], (1.0 - strength) * plain[hidden], rtol=1e-9)
    np.testing.assert_allclose(film[seen], plain[seen], rtol=1e-9)
