"""Node `index_planner`: recommends the index between passes, and plans passes on a part."""

from __future__ import annotations

import math
from typing import Any

from nav_msgs.msg import Path as PathMessage
from paint_msgs.srv import RecommendIndex
from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import PaintError
from paint_deposition.files.meshes import read_mesh
from paint_deposition.files.model_file import read_model
from paint_deposition.nodes.planning.path_message import path_message
from paint_deposition.nodes.planning.planner_parameters import PLANNER
from paint_deposition.nodes.runtime import qos
from paint_deposition.nodes.runtime.diagnostics import OK, WARN, Diagnostics, Status
from paint_deposition.nodes.runtime.shutdown import PaintNode, run_node
from paint_deposition.planning.index_request import Request
from paint_deposition.planning.plan import PlanRequest, plan
from paint_deposition.planning.recommendation import Recommendation, recommend


class IndexPlanner(PaintNode):
    """Answers `recommend_index` for its model; plans and publishes passes if it has a mesh.

    The planned motion goes out latched on `planned_path`, in the frame of the mesh.
    """

    PARAMETERS = PLANNER

    def __init__(self, **kwargs: Any):
        super().__init__('index_planner', **kwargs)
        try:
            self._model = _model_of(self.values['model_file'])
            path = self._planned() if self.values['mesh_file'] else None
        except PaintError:
            self.destroy_node()
            raise
        self._next_model = self._model
        self._asked = 0
        self._last = Status(OK, 'not asked yet')
        self.create_service(RecommendIndex, 'recommend_index', self._recommend)
        self._path_publisher = self.create_publisher(PathMessage, 'planned_path', qos.LATCHED)
        if path is not None:
            self._path_publisher.publish(path)
        self._diagnostics = Diagnostics(self, {'index': self._status})
        self.add_on_set_parameters_callback(self._check_changes)
        self.add_post_set_parameters_callback(self._apply_changes)

    # --- recommending

    def _recommend(
        self, request: RecommendIndex.Request, response: RecommendIndex.Response
    ) -> RecommendIndex.Response:
        self._asked += 1
        try:
            answer = recommend(self._model, self._asked_for(request))
        except PaintError as error:
            self._last = Status(WARN, str(error))
            response.message = str(error)
            return response
        self._last = Status(OK, answer.sentence)
        return _fill(response, answer)

    def _asked_for(self, request: RecommendIndex.Request) -> Request:
        return Request(
            speed_m_per_s=_given(request.speed_m_per_s),
            target_um=_given(request.target_um),
            index_min_m=_given(request.index_min_m),
            index_max_m=_given(request.index_max_m),
            tolerance=_given(request.tolerance),
            width_m=_given(request.width_m) or _given(self.values['width_m']),
            length_m=_given(self.values['length_m']),
            one_way=request.one_way,
            gun_turns=self.values['gun_turns'],
            standoff_m=_given(self.values['standoff_m']),
            travel_rad=self.values['travel_rad'],
        )

    # --- planning

    def _planned(self) -> PathMessage:
        values = self.values
        surface = read_mesh(values['mesh_file'], values['mesh_scale'], values['max_edge_length_m'])
        for note in surface.notes:
            self.get_logger().warning(note)
        frame_id = values['frame_id'].lstrip('/')
        planned = plan(
            surface,
            self._model,
            PlanRequest(
                direction=values['direction'],
                speed_m_per_s=_given(values['speed_m_per_s']),
                target_um=_given(values['target_um']),
                index_m=_given(values['index_m']),
                standoff_m=_given(values['standoff_m']),
                smoothing_radius_m=values['smoothing_radius_m'],
                acceleration_m_per_s2=values['acceleration_m_per_s2'],
                travel_rad=values['travel_rad'],
                outward=tuple(values['outward']) or None,
            ),
            frame_id,
        )
        self.get_logger().info(planned.sentence)
        return path_message(planned.trajectory, self.get_clock().now().nanoseconds)

    # --- state

    def _check_changes(self, changes: list[Parameter]) -> SetParametersResult:
        """Read a new model before the change is accepted, so that a bad file is refused."""
        for change in changes:
            if change.name == 'model_file':
                try:
                    self._next_model = _model_of(change.value)
                except PaintError as error:
                    return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply_changes(self, changes: list[Parameter]) -> None:
        self.values |= {change.name: change.value for change in changes}
        if any(change.name == 'model_file' for change in changes):
            self._model = self._next_model

    def _status(self) -> Status:
        values = {
            'model': self.values['model_file'] or 'a 50 mm bell',
            'effects': ' '.join(effect.id for effect in self._model.effects) or 'none',
            'requests': self._asked,
        }
        return Status(self._last.level, self._last.message, values)


def _model_of(model_file: str) -> DepositionModel:
    return read_model(model_file) if model_file else DepositionModel()


def _given(value: float) -> float | None:
    """A number of a request or parameter, in which 0 stands for none."""
    return None if value == 0.0 else value


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else float(value)


def _fill(response: RecommendIndex.Response, answer: Recommendation) -> RecommendIndex.Response:
    response.success = True
    response.message = '; '.join([answer.sentence, *answer.notes])
    response.index_m = answer.index_m
    response.sigma_n = answer.sigma_n
    response.index_range_m = list(answer.index_range_m)
    response.tolerance = _or_nan(answer.tolerance)
    response.window_low_m = [low for low, _ in answer.windows_m]
    response.window_high_m = [high for _, high in answer.windows_m]
    response.minima_index_m = [minimum.index_m for minimum in answer.minima]
    response.minima_sigma_n = [minimum.sigma_n for minimum in answer.minima]
    response.mean_um = answer.mean_um
    response.speed_m_per_s = answer.speed_m_per_s
    response.passes = answer.passes or 0
    response.cycle_time_s = _or_nan(answer.cycle_time_s)
    response.travel = answer.travel
    response.curve_index_m = answer.curve.index_m.tolist()
    response.curve_sigma_n = answer.curve.sigma_n.tolist()
    index_drift = answer.index_drift_m or (math.nan, math.nan)
    standoff_drift = answer.standoff_drift_m or (math.nan, math.nan)
    response.index_drift_low_m, response.index_drift_high_m = index_drift
    response.standoff_drift_low_m, response.standoff_drift_high_m = standoff_drift
    return response


def main() -> int:
    """Run the node; the return value is the process's exit code."""
    return run_node(IndexPlanner)
