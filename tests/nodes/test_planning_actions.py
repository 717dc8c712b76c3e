"""Passes as an action over real DDS: feedback, result, refusal and cancel."""

import pytest
from action_msgs.msg import GoalStatus
from nav_msgs.msg import Path
from paint_msgs.action import PlanPasses
from paint_msgs.srv import RecommendIndex
from rclpy.action import ActionClient

from nodes.cell import parameters, write_panel
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.files.meshes import read_mesh
from paint_deposition.nodes.index_planner import IndexPlanner
from paint_deposition.nodes.runtime import topics
from paint_deposition.planning.plan import plan
from paint_deposition.planning.requests import PlanRequest

COARSE = {'max_edge_length_m': 0.05, 'speed_m_per_s': 0.25}


@pytest.fixture
def planner(ros_context, spin, tmp_path):
    """`planner(**parameters)`: a planner that runs, and is closed at the end."""
    made = []

    def planner(**values) -> IndexPlanner:
        chosen = parameters(**COARSE | {'input_folders': [str(tmp_path)]} | values)
        made.append(IndexPlanner(context=ros_context, parameter_overrides=chosen))
        spin(made[-1])
        return made[-1]

    yield planner
    for node in made:
        node.close()


@pytest.fixture
def ask(onlooker, wait_until):
    """`ask(action, name, cancel_at='', **goal)`: the status, the result and the feedback.

    A goal that is cancelled at a stage must end within two seconds.
    """
    user = onlooker({})

    def ask(action, action_name, cancel_at='', **goal):
        client = ActionClient(user, action, action_name)
        wait_until(client.server_is_ready, what=f'action {action_name}')
        heard, cancelled = [], []

        def hear(message) -> None:
            heard.append(message.feedback)
            if message.feedback.stage == cancel_at and sent.done() and not cancelled:
                cancelled.append(sent.result().cancel_goal_async())

        sent = client.send_goal_async(action.Goal(**goal), feedback_callback=hear)
        wait_until(sent.done, what='the goal')
        done = sent.result().get_result_async()
        wait_until(lambda: cancelled or done.done(), what='the result')
        wait_until(done.done, what='the end', timeout_s=2.0 if cancelled else 0.0)
        client.destroy()
        return done.result().status, done.result().result, heard

    return ask


def test_passes_are_planned_with_feedback(planner, ask, onlooker, wait_until, tmp_path):
    mesh = write_panel(tmp_path / 'panel.stl')
    planner()
    viewer = onlooker({'planned_path': (Path, topics.LATCHED)})
    status, result, heard = ask(
        PlanPasses, 'plan_passes', mesh_file=str(mesh), target_um=15.0, direction='vertical'
    )
    assert status == GoalStatus.STATUS_SUCCEEDED, result.message
    expected = plan(
        read_mesh(mesh, max_edge_length_m=0.05),
        DepositionModel(),
        PlanRequest(direction='vertical', target_um=15.0),
    )
    assert result.message == expected.sentence
    assert (result.passes, result.mean_um) == (len(expected.passes), expected.mean_um)
    assert result.speed_m_per_s == expected.style.speed_m_per_s
    stages = [feedback.stage for feedback in heard]
    assert stages[:2] == ['begin', 'reading the mesh']
    assert {'single passes', 'film'} <= set(stages)
    wait_until(lambda: viewer.newest('planned_path'), what='the path')
    path = viewer.newest('planned_path')
    assert path == result.path
    assert len(path.poses) > 10


def test_the_service_answers_while_passes_are_planned_and_cancel_ends_it(
    planner, ask, onlooker, wait_until, tmp_path
):
    """What has no answer is aborted with the reason."""
    mesh = write_panel(tmp_path / 'panel.stl')
    planner(max_edge_length_m=0.01)
    client = onlooker({}).create_client(RecommendIndex, 'recommend_index')
    wait_until(client.service_is_ready)
    answer = client.call_async(RecommendIndex.Request(speed_m_per_s=0.3))
    status, result, heard = ask(
        PlanPasses, 'plan_passes', cancel_at='single passes', mesh_file=str(mesh)
    )
    assert status == GoalStatus.STATUS_CANCELED
    assert (result.success, result.message) == (False, 'cancelled')
    assert heard[-1].stage == 'single passes'
    wait_until(answer.done)
    assert answer.result().success
    status, result, _ = ask(PlanPasses, 'plan_passes')
    assert status == GoalStatus.STATUS_ABORTED
    assert result.message == 'mesh_file is empty: name the mesh of the part'
    status, result, _ = ask(PlanPasses, 'plan_passes', mesh_file='nowhere.stl')
    assert 'nowhere.stl: no such mesh file' in result.message
