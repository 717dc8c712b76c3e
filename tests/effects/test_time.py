"""Effects of clocks and of time of flight."""

from dataclasses import replace

import numpy as np
import pytest

from booth import painted, panel, path_of, serpentine
from paint_deposition.effects.base import PathContext
from paint_deposition.effects.library.flow_drift import FlowDrift
from paint_deposition.effects.library.gun_wake import GunWake
from paint_deposition.effects.library.pose_lag import PoseLag
from paint_deposition.effects.library.trigger_lag import TriggerLag
from paint_deposition.model.eq2_projection import Projection


@pytest.mark.parametrize('lag_s', [-0.05, -0.007, 0.003, 0.04])
@pytest.mark.parametrize('flow', [1.0, 0.6])
def test_pose_lag_is_a_trigger_recorded_later(lag_s, flow):
    trajectory = serpentine((0.1, -0.1), flow=flow)
    shifted_ns = trajectory.trigger_stamps_ns + round(lag_s * 1e9)
    expected = painted(panel(), replace(trajectory, trigger_stamps_ns=shifted_ns)).raw_um
    film = painted(panel(), trajectory, PoseLag(lag_s=lag_s)).raw_um
    np.testing.assert_allclose(film, expected, atol=2e-3 * expected.max())


@pytest.mark.parametrize('lag', [TriggerLag(rise_s=0.05, fall_s=0.05), PoseLag(lag_s=0.02)])
def test_what_flows_behind_a_closing_has_drifted_like_the_pass(lag):
    path = path_of(serpentine((0.1, -0.1)))
    drifts = FlowDrift(drift_per_pass=0.2)
    context = PathContext(Projection(), *(np.eye(3)[[2, 1, 0]] * [[-1.0], [-1.0], [0.0]]))
    drifted_then_late = lag.on_path(drifts.on_path(path, context), context)
    late_then_drifted = drifts.on_path(lag.on_path(path, context), context)
    np.testing.assert_allclose(drifted_then_late.flow, late_then_drifted.flow, rtol=1e-12)


def test_gun_wake_is_the_whole_pass_moved_back():
    trajectory = serpentine((0.0,), speed_m_per_s=0.35)
    moved = replace(trajectory, positions_m=trajectory.positions_m - [0.02 * 0.35, 0.0, 0.0])
    film = painted(panel(), trajectory, GunWake(lag_s=0.02)).raw_um
    expected = painted(panel(), moved).raw_um
    np.testing.assert_allclose(film, expected, atol=1e-9 * expected.max())
