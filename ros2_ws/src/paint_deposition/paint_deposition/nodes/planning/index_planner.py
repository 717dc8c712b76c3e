"""Node `index_planner`: recommends the index between passes, and plans passes on a part."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from paint_msgs.srv import RecommendIndex
from rclpy.time import Time

from paint_deposition.errors import PaintError
from paint_deposition.files.meshes import read_mesh
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.nodes.planning.planner_parameters import PLANNER
from paint_deposition.nodes.runtime import qos
from paint_deposition.nodes.runtime.diagnostics import OK, WARN, Diagnostics, Status
from paint_deposition.nodes.runtime.model_parameters import read_chosen_model
from paint_deposition.nodes.runtime.paint_node import PaintNode
from paint_deposition.nodes.runtime.process import run_node
from paint_deposition.planning.index_request import Request
from paint_deposition.planning.plan import PlanRequest, plan
from paint_deposition.planning.recommendation import Recommendation, recommend

SPACING_M = 0.02


class IndexPlanner(PaintNode):
    """Answers `recommend_index` for its model; plans and publishes passes if it has a mesh.

    The planned motion goes out latched on `planned_path`, in the frame of the mesh.
    """

    PARAMETERS = PLANNER

    def __init__(self, **kwargs: Any):
        super().__init__('index_planner', **kwargs)
        self._asked = 0
        self._last = Status(OK, 'not asked yet')
        self.create_service(RecommendIndex, 'recommend_index', self._recommend)
        self._path_publisher = self.create_publisher(Path, 'planned_path', qos.LATCHED)
        if self._path is not None:
            self._path_publisher.publish(self._path)
        self._diagnostics = Diagnostics(self, {'index': self._status})

    def _prepare(self) -> None:
        self._model = read_chosen_model(self.values)
        self._path = self._planned() if self.values['mesh_file'] else None

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

    def _planned(self) -> Path:
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
        return _path_message(planned.trajectory, self.get_clock().now().nanoseconds)

    # --- state

    def _check_change(self, values: Mapping[str, Any], names: set[str]) -> None:
        if 'model_file' in names:
            self._next_model = read_chosen_model(values)

    def _changed(self, names: set[str]) -> None:
        if 'model_file' in names:
            self._model = self._next_model

    def _status(self) -> Status:
        values = {
            'model': self.values['model_file'] or 'a 50 mm bell',
            'effects': ' '.join(effect.id for effect in self._model.effects) or 'none',
            'requests': self._asked,
        }
        return Status(self._last.level, self._last.message, values)


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


def _path_message(trajectory: Trajectory, start_ns: int) -> Path:
    """Poses about SPACING_M apart, both ends included; stamps count from the start."""
    step = np.linalg.norm(np.diff(trajectory.positions_m, axis=0), axis=1)
    travelled = np.floor(np.concatenate([[0.0], np.cumsum(step)]) / SPACING_M)
    kept = np.append(True, np.diff(travelled) > 0.0)
    kept[-1] = True
    message = Path()
    message.header.frame_id = trajectory.frame_id
    message.header.stamp = Time(nanoseconds=start_ns).to_msg()
    first_ns = int(trajectory.stamps_ns[0])
    for row in np.flatnonzero(kept):
        pose = PoseStamped()
        pose.header.frame_id = trajectory.frame_id
        stamp_ns = start_ns + int(trajectory.stamps_ns[row]) - first_ns
        pose.header.stamp = Time(nanoseconds=stamp_ns).to_msg()
        p, q = pose.pose.position, pose.pose.orientation
        p.x, p.y, p.z = trajectory.positions_m[row].tolist()
        q.x, q.y, q.z, q.w = trajectory.quaternions_xyzw[row].tolist()
        message.poses.append(pose)
    return message


def main() -> int:
    """Run the node; the return value is the process's exit code."""
    return run_node(IndexPlanner)
