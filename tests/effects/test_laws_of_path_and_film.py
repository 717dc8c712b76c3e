"""Laws of the motion, of time and of the film that lies, in closed form on known parts."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from booth import MODEL, painted, panel, path_of, serpentine, spot
from paint_deposition.effects.base import PathContext
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.effects.library.flow_drift import MIDDLE_PASS
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.part.points import SurfacePoints

CONTEXT = PathContext(
    MODEL.projection, np.array([0.0, 0.0, -1.0]), np.array([0.0, -1.0, 0.0]), np.zeros(3)
)
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
    [
        (serpentine((0.1, -0.1)), 0.03, 2e-5),
        (serpentine((0.1, -0.1), flow=0.5), 0.03, 2e-5),
        (blinking(), 0.05, 5e-4),
    ],
    ids=['full flow', 'half flow', 'blinking'],
)
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


def test_gun_wake_is_the_whole_pass_moved_back():
    trajectory = serpentine((0.0,), speed_m_per_s=0.35)
    moved = replace(trajectory, positions_m=trajectory.positions_m - [0.02 * 0.35, 0.0, 0.0])
    film = painted(panel(), trajectory, EFFECTS['gun_wake'](lag_s=0.02)).raw_um
    expected = painted(panel(), moved).raw_um
    np.testing.assert_allclose(film, expected, atol=1e-9 * expected.max())


def test_flow_drifts_from_pass_to_pass():
    path = path_of(serpentine((0.3, 0.1, -0.1, -0.3)))
    drifting = EFFECTS['flow_drift'](drift_per_pass=-0.05)
    for number in range(4):
        one_pass = path.select(path.spray_pass == number)
        plain, film = (painted(panel(), one_pass, *e).raw_um for e in ((), (drifting,)))
        np.testing.assert_allclose(film, plain * 0.95 ** (number - MIDDLE_PASS), rtol=1e-9)


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
        point = SurfacePoints(
            np.zeros((1, 3)), np.array([[0.0, -1.0, 0.0]]), curvature_per_m=np.array([curvature])
        )
        film_um = effect.on_film(np.array([20.0]), point)
        found += effect.on_gauge(film_um, point).tolist()
        if name == 'gauge_curvature_bias':
            assert film_um == 20.0
            assert effect.on_gauge(np.zeros(1), point) == pytest.approx(found[-1] - 20.0)
    assert found == pytest.approx([convex_um, flat_um, concave_um])


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
