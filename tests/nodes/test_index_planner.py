"""The index planner over real DDS."""

import math
from itertools import pairwise

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from nav_msgs.msg import Path
from paint_msgs.srv import RecommendIndex

from nodes.cell import PANEL_M, parameters, write_panel
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.files.model_file import write_model
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.nodes.index_planner import IndexPlanner
from paint_deposition.nodes.runtime import topics
from paint_deposition.planning.recommendation import recommend
from paint_deposition.planning.requests import IndexRequest

NARROW = DepositionModel(planar=PlanarPattern(K3=0.0, r_m=0.11, sigma1_m=0.045, sigma2_m=0.075))


@pytest.fixture
def planner(ros_context, spin, tmp_path):
    """`planner(**parameters)`: an index planner that runs."""

    def planner(**values) -> IndexPlanner:
        chosen = parameters(**{'input_folders': [str(tmp_path)]} | values)
        node = IndexPlanner(context=ros_context, parameter_overrides=chosen)
        spin(node)
        return node

    return planner


@pytest.fixture
def viewer(onlooker):
    return onlooker({'planned_path': (Path, topics.LATCHED)})


@pytest.fixture
def ask(viewer, call):
    """`ask(**request)`: what the service answers."""

    def ask(**request) -> RecommendIndex.Response:
        return call(viewer, RecommendIndex, 'recommend_index', RecommendIndex.Request(**request))

    return ask


def test_answer_is_the_recommendation(planner, ask, viewer, wait_until):
    planner()
    answer = ask(speed_m_per_s=0.2, tolerance=0.1, width_m=1.5)
    expected = recommend(
        DepositionModel(), IndexRequest(speed_m_per_s=0.2, tolerance=0.1, width_m=1.5)
    )
    assert answer.success
    assert answer.index_m == expected.index_m
    assert answer.sigma_n == expected.sigma_n
    assert list(answer.index_range_m) == [0.2, 0.8]
    assert list(answer.window_high_m) == [high for _, high in expected.windows_m]
    assert list(answer.minima_index_m) == [m.index_m for m in expected.minima]
    assert (answer.passes, answer.travel) == (expected.passes, 'alternating')
    assert answer.cycle_time_s == expected.cycle_time_s
    assert answer.mean_um == expected.mean_um
    np.testing.assert_array_equal(answer.curve_sigma_n, expected.curve.sigma_n)
    assert answer.standoff_drift_low_m == expected.standoff_drift_m[0]
    assert 'keeps its orientation' in answer.message
    name = 'index_planner: index'
    wait_until(lambda: viewer.reports(name, 'sigma_n'), what='diagnostics')
    assert viewer.value(name, 'model') == 'a 50 mm bell'


def test_impossible_requests_say_why(planner, ask):
    node = planner()
    for request, words in (
        ({}, 'neither speed_m_per_s nor target_um'),
        ({'speed_m_per_s': math.nan}, 'speed_m_per_s is nan'),
        (
            {'speed_m_per_s': 1e-5, 'target_um': 20.0},
            'expected a number 0.005 to 3',
        ),
        ({'speed_m_per_s': 0.2, 'tolerance': 1e-6}, 'the closest is'),
    ):
        answer = ask(**request)
        assert not answer.success
        assert words in answer.message
        assert '\n' not in answer.message
        assert node.status().level == DiagnosticStatus.WARN


def test_model_can_be_exchanged_and_a_bad_one_is_refused(planner, ask, tmp_path):
    write_model(tmp_path / 'narrow.yaml', NARROW)
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


def test_passes_are_planned_on_a_mesh_and_latched(planner, viewer, wait_until, tmp_path):
    mesh = write_panel(tmp_path / 'panel.stl')
    planner(mesh_file=str(mesh), frame_id='panel', speed_m_per_s=0.0, target_um=15.0)
    wait_until(lambda: viewer.newest('planned_path'), what='the latched path')
    path = viewer.newest('planned_path')
    assert path.header.frame_id == 'panel'
    at = np.array([[p.pose.position.x, p.pose.position.y, p.pose.position.z] for p in path.poses])
    # The panel stands in x-z and looks to -y; passes run along x, past both its edges.
    np.testing.assert_allclose(at[:, 1], -0.25, atol=1e-6)
    assert np.ptp(at[:, 0]) > PANEL_M + 0.4
    stamps = [p.header.stamp.sec * 10**9 + p.header.stamp.nanosec for p in path.poses]
    assert all(later > earlier for earlier, later in pairwise(stamps))
