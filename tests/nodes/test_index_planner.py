"""The index planner over real DDS: the service, and passes as an action."""

import math
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from diagnostic_msgs.msg import DiagnosticStatus
from paint_msgs.action import PlanPasses
from paint_msgs.srv import RecommendIndex
from rclpy.action import ActionClient

import paint_deposition as pd
from nodes.cell import PANEL_M, parameters, write_panel
from paint_deposition.files.recordings.messages import stamp_ns
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.nodes.index_planner import IndexPlanner
from paint_deposition.planning.plan import plan
from paint_deposition.planning.recommendation import recommend
from paint_deposition.planning.requests import IndexRequest, PlanRequest

NARROW = pd.DepositionModel(planar=PlanarPattern(K3=0.0, r_m=0.11, sigma1_m=0.045, sigma2_m=0.075))


@pytest.fixture
def planner(closed, tmp_path):
    """`planner(**parameters)`: an index planner that runs."""
    return lambda **values: closed(IndexPlanner, **{'input_folders': [str(tmp_path)]} | values)


@pytest.fixture
def viewer(onlooker):
    return onlooker('planned_path')


@pytest.fixture
def ask(viewer, call):
    """`ask(**request)`: what the service answers."""
    return partial(call, viewer, RecommendIndex, 'recommend_index')


def test_answer_is_the_recommendation_or_why_there_is_none(planner, ask, viewer, wait_until):
    node = planner()
    wanted = {'speed_m_per_s': 0.2, 'tolerance': 0.1, 'width_m': 1.5}
    answer = ask(**wanted)
    expected = recommend(pd.DepositionModel(), IndexRequest(**wanted))
    assert answer.success
    for name in ('index_m', 'sigma_n', 'passes', 'cycle_time_s', 'mean_um'):
        assert getattr(answer, name) == getattr(expected, name)
    assert list(answer.index_range_m) == [0.2, 0.8]
    assert list(answer.window_high_m) == [high for _, high in expected.windows_m]
    assert list(answer.minima_index_m) == [index_m for index_m, _ in expected.curve.minima]
    assert answer.travel == 'alternating'
    np.testing.assert_array_equal(answer.curve_sigma_n, expected.curve.sigma_n)
    assert answer.standoff_drift_low_m == expected.standoff_drift_m[0]
    assert 'keeps its orientation' in answer.message
    name = 'index_planner: index'
    wait_until(lambda: viewer.reports(name, 'sigma_n'), what='diagnostics')
    assert viewer.value(name, 'model') == 'a 50 mm bell'
    for request, words in (
        ({}, 'neither speed_m_per_s nor target_um'),
        ({'speed_m_per_s': math.nan}, 'speed_m_per_s is nan'),
        ({'speed_m_per_s': 1e-5, 'target_um': 20.0}, 'expected a number 0.005 to 3'),
        ({'speed_m_per_s': 0.2, 'tolerance': 1e-6}, 'the closest is'),
    ):
        answer = ask(**request)
        assert not answer.success
        assert words in answer.message
        assert '\n' not in answer.message
        assert node.status()[0] == DiagnosticStatus.WARN


def test_model_can_be_exchanged_and_a_bad_one_is_refused(planner, ask, tmp_path):
    pd.write_model(tmp_path / 'narrow.yaml', NARROW)
    (tmp_path / 'broken.yaml').write_text('planar: {K9: 1}\n')
    node = planner()
    wide = ask(speed_m_per_s=0.2, index_min_m=0.5, index_max_m=0.7).index_m
    (result,) = node.set_parameters(parameters(model_file=str(tmp_path / 'narrow.yaml')))
    assert result.successful
    narrow = ask(speed_m_per_s=0.2, index_min_m=0.25, index_max_m=0.35).index_m
    assert narrow == pytest.approx(0.5 * wide, rel=0.03)
    (result,) = node.set_parameters(parameters(model_file=str(tmp_path / 'broken.yaml')))
    assert not result.successful
    assert 'K9' in result.reason
    assert ask(speed_m_per_s=0.2, tolerance=0.1).index_m == pytest.approx(0.5 * wide, rel=0.03)


@pytest.fixture
def pursue(onlooker, wait_until):
    """`pursue(cancel_at='', **goal)`: status, result, feedback; cancelled it ends within 2 s."""
    user = onlooker()

    def pursue(cancel_at='', **goal):
        client = ActionClient(user, PlanPasses, 'plan_passes')
        wait_until(client.server_is_ready, what='the action')
        heard, cancelled = [], []

        def hear(message) -> None:
            heard.append(message.feedback)
            if message.feedback.stage == cancel_at and sent.done() and not cancelled:
                cancelled.append(sent.result().cancel_goal_async())

        sent = client.send_goal_async(PlanPasses.Goal(**goal), feedback_callback=hear)
        wait_until(sent.done, what='the goal')
        done = sent.result().get_result_async()
        wait_until(lambda: cancelled or done.done(), what='the result')
        wait_until(done.done, what='the end', timeout_s=2.0 if cancelled else 0.0)
        client.destroy()
        return done.result().status, done.result().result, heard

    return pursue


def test_passes_are_planned_and_latched(planner, pursue, viewer, wait_until, tmp_path):
    """On the mesh of the node at its start, and for a goal with feedback."""
    mesh = write_panel(tmp_path / 'panel.stl')
    chosen = {'mesh_file': str(mesh), 'frame_id': 'panel', 'max_edge_length_m': 0.05}
    planner(**chosen, speed_m_per_s=0.0, target_um=15.0)
    wait_until(lambda: viewer.newest('planned_path'), what='the latched path')
    path = viewer.newest('planned_path')
    assert path.header.frame_id == 'panel'
    at = np.array([[p.pose.position.x, p.pose.position.y, p.pose.position.z] for p in path.poses])
    # The panel stands in x-z and looks to -y; passes run along x, past both its edges.
    np.testing.assert_allclose(at[:, 1], -0.25, atol=1e-6)
    assert np.ptp(at[:, 0]) > PANEL_M + 0.4
    stamps = [stamp_ns(pose.header) for pose in path.poses]
    assert all(later > earlier for earlier, later in pairwise(stamps))

    status, result, heard = pursue(mesh_file=str(mesh), target_um=15.0, direction='vertical')
    assert status == GoalStatus.STATUS_SUCCEEDED, result.message
    surface = pd.read_mesh(mesh, max_edge_length_m=0.05)
    wanted = PlanRequest(direction='vertical', target_um=15.0)
    expected = plan(surface, pd.DepositionModel(), wanted)
    assert result.message == expected.sentence
    assert (result.passes, result.mean_um) == (len(expected.passes), expected.mean_um)
    assert result.speed_m_per_s == expected.style.speed_m_per_s
    stages = [feedback.stage for feedback in heard]
    assert stages[:2] == ['begin', 'reading the mesh']
    assert {'single passes', 'film'} <= set(stages)
    wait_until(lambda: viewer.newest('planned_path') == result.path, what='the path')
    assert len(result.path.poses) > 10


def test_answers_go_on_and_cancel_ends_a_plan(
    planner, pursue, viewer, asked, wait_until, tmp_path
):
    """What has no answer is aborted with the reason."""
    mesh = write_panel(tmp_path / 'panel.stl')
    planner(max_edge_length_m=0.01, speed_m_per_s=0.25)
    answer = asked(viewer, RecommendIndex, 'recommend_index', speed_m_per_s=0.3)
    status, result, heard = pursue(cancel_at='single passes', mesh_file=str(mesh))
    assert status == GoalStatus.STATUS_CANCELED
    assert (result.success, result.message) == (False, 'cancelled')
    assert heard[-1].stage == 'single passes'
    wait_until(answer.done)
    assert answer.result().success
    status, result, _ = pursue()
    assert status == GoalStatus.STATUS_ABORTED
    assert result.message == 'mesh_file is empty: name the mesh of the part'
    status, result, _ = pursue(mesh_file='nowhere.stl')
    assert 'nowhere.stl: no such mesh file' in result.message
