"""Effects at edges, turns and trigger changes."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from booth import MODEL, panel, path_of, serpentine
from paint_deposition.effects.base import PathContext
from paint_deposition.effects.library.corner_slowdown import CornerSlowdown
from paint_deposition.effects.library.edge_build import EdgeBuild
from paint_deposition.effects.library.trigger_lag import TriggerLag
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.path_builder import spray_path

CONTEXT = PathContext(
    MODEL.projection, np.array([0.0, 0.0, -1.0]), np.array([0.0, -1.0, 0.0]), np.zeros(3)
)


def after(effect, path: SprayPath) -> SprayPath:
    return effect.on_path(path, CONTEXT)


def test_edge_build_decays_from_the_edge_on_all_sides_alike():
    points = panel().points()
    film = EdgeBuild(gain=0.3, length_m=0.02).on_film(np.full(len(points), 10.0), points)
    x, _, z = points.positions_m.T
    for inward in (0.5 - x, 0.5 + x, 0.5 - z, 0.5 + z):
        beside = np.isclose(np.minimum(np.minimum(0.5 - abs(x), 0.5 - abs(z)), 0.5), inward)
        expected = 10.0 * (1.0 + 0.3 * np.exp(-inward[beside] / 0.02))
        np.testing.assert_allclose(film[beside], expected, rtol=1e-9)


def test_corner_slowdown_acts_at_turns_and_ends_and_nowhere_else():
    path = path_of(serpentine((0.2, -0.2), half_width_m=0.45))
    slower = after(CornerSlowdown(gain=0.4, length_m=0.03), path).dwell_s / path.dwell_s - 1.0
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


@pytest.mark.parametrize('flow', [1.0, 0.5])
def test_trigger_lag_solves_its_equation(flow):
    trajectory = serpentine((0.1, -0.1), flow=flow)
    path = spray_path(trajectory, max_step_m=2e-4)[0]
    lagged = after(TriggerLag(rise_s=0.05, fall_s=0.03), path)
    times = (path.stamp_ns - trajectory.stamps_ns[0]) * 1e-9
    expected = lagged_flow(trajectory, 0.05, 0.03, times)
    np.testing.assert_allclose(lagged.flow, expected, atol=2e-5)


def test_what_is_left_of_one_opening_helps_the_next():
    trajectory = serpentine((0.0,), opens_at_m=0.25)
    begin = trajectory.trigger_stamps_ns[0]
    blink = begin + np.array([0, 400, 420, 900]) * 1_000_000
    trajectory = type(trajectory)(
        trajectory.stamps_ns, trajectory.positions_m, trajectory.quaternions_xyzw, '',
        blink, np.array([1.0, 0.0, 1.0, 0.0]),
    )  # fmt: skip
    path = spray_path(trajectory, max_step_m=2e-4)[0]
    lagged = after(TriggerLag(rise_s=0.05, fall_s=0.05), path)
    times = (path.stamp_ns - trajectory.stamps_ns[0]) * 1e-9
    np.testing.assert_allclose(lagged.flow, lagged_flow(trajectory, 0.05, 0.05, times), atol=5e-4)


@pytest.mark.parametrize('step_m', [8e-3, 1e-3])
def test_trigger_lag_takes_tau_on_and_gives_tau_off_however_coarse_the_steps(step_m):
    path = spray_path(serpentine((0.0,)), max_step_m=step_m)[0]
    sprayed_s = path.spraying_time_s
    assert after(TriggerLag(rise_s=0.01), path).spraying_time_s == pytest.approx(sprayed_s - 0.01)
    assert after(TriggerLag(fall_s=0.01), path).spraying_time_s == pytest.approx(sprayed_s + 0.01)
    both = after(TriggerLag(rise_s=0.02, fall_s=0.02), path)
    assert both.spraying_time_s == pytest.approx(sprayed_s, rel=1e-9)
