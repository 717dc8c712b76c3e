"""Node `index_planner`: recommends the index between passes, and plans passes on a part."""

import math
import os
import time
from collections.abc import Callable, Mapping
from concurrent.futures import CancelledError, ThreadPoolExecutor
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from paint_msgs.action import PlanPasses
from paint_msgs.srv import RecommendIndex
from rclpy.action.server import ActionServer, CancelResponse, ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import PaintError, PlanError
from paint_deposition.files.meshes import read_mesh
from paint_deposition.model.brush import MOST
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.nodes.painting.painting_parameters import (
    model_from_parameters,
    model_parameters,
)
from paint_deposition.nodes.runtime import topics
from paint_deposition.nodes.runtime.messages import header
from paint_deposition.nodes.runtime.node import OK, WARN, Diagnostics, PaintNode, Status
from paint_deposition.nodes.runtime.parameters import (
    NodeParameter,
    direction_parameter,
    fixed_while_running,
    mesh_parameters,
    thickness_parameter,
)
from paint_deposition.planning.plan import Plan, plan
from paint_deposition.planning.recommendation import Recommendation, recommend
from paint_deposition.planning.requests import FASTEST_M_PER_S, IndexRequest, PlanRequest

SPACING_M = 0.02
# 0 stands for none in fields of a service request and in optional parameters.
REQUEST_FIELDS = ('speed_m_per_s', 'target_um', 'index_min_m', 'index_max_m', 'tolerance')
OPTIONAL_PARAMETERS = ('speed_m_per_s', 'target_um', 'index_m', 'standoff_m')
REQUIRED_PARAMETERS = ('direction', 'smoothing_radius_m', 'acceleration_m_per_s2', 'travel_rad')

FEEDBACK_PERIOD_S = 0.1
# Fields of a goal that replace the parameters of the same names.
GOAL_FIELDS = ('mesh_file', 'speed_m_per_s', 'target_um', 'index_m', 'direction')

# (stage, share of it that is done, 0 to 1); it raises CancelledError to cancel the work.
Progress = Callable[[str, float], None]
# (parameters to replace, progress) -> plan, published path.
PlanAndPublish = Callable[[Mapping[str, Any], Progress], tuple[Plan, Path]]


PLANNER = dict(
    **model_parameters(''),
    brush=NodeParameter(
        0,
        'Number of the brush to plan for, of a model with several; 0: the only one [-]',
        (0, MOST),
    ),
    width_m=NodeParameter(
        0.0, 'Width to paint where a request gives none; 0: none [m]', (0.0, 100.0)
    ),
    length_m=NodeParameter(
        0.0, 'Length of a pass, for the cycle time; 0: as long as the width [m]', (0.0, 100.0)
    ),
    standoff_m=NodeParameter(
        0.0,
        'Distance of the TCP from the part; 0: the part lies on the model plane [m]',
        (0.0, 5.0),
    ),
    travel_rad=NodeParameter(
        0.0,
        "Direction of the first pass in the tool's x-y frame, from x to y [rad]",
        (-2.0 * math.pi, 2.0 * math.pi),
    ),
    gun_turns=NodeParameter(
        False,
        'Turn the gun by 180 deg for every return pass; else it keeps its orientation and '
        'lays the same profile both ways [true/false]',
    ),
    **fixed_while_running(
        'passes are planned once, when the node starts; restart the node with the new value',
        **mesh_parameters(max_edge_length_m=0.02),
        direction=NodeParameter(
            'horizontal',
            'How planned passes run on the part [name]',
            choices=('horizontal', 'vertical'),
        ),
        speed_m_per_s=NodeParameter(
            0.3, 'Speed of planned passes; 0: from target_um [m/s]', (0.0, FASTEST_M_PER_S)
        ),
        target_um=thickness_parameter('Mean film of planned passes where speed_m_per_s is 0 [µm]'),
        index_m=NodeParameter(
            0.0, 'Distance between planned passes; 0: the most even [m]', (0.0, 10.0)
        ),
        smoothing_radius_m=NodeParameter(
            PlanRequest.model_fields['smoothing_radius_m'].default,
            'Radius over which the surface is smoothed; finer shapes are not followed [m]',
            (0.005, 2.0),
        ),
        acceleration_m_per_s2=NodeParameter(
            2.0, 'Acceleration of the robot [m/s^2]', (0.05, 50.0)
        ),
        outward=direction_parameter(
            'Direction from the part to the gun, any length; empty: the mean normal [-]'
        ),
    ),
)


class IndexPlanner(PaintNode):
    """Provides `recommend_index` and `plan_passes`; with a mesh, plans passes at the start.

    The planned motion is published on `planned_path`, latched, in the frame of the mesh.
    """

    PARAMETERS = PLANNER

    def __init__(self, **kwargs: Any):
        super().__init__('index_planner', **kwargs)
        self._requests = 0
        self._last = Status(OK, 'no request yet')
        self.create_service(RecommendIndex, 'recommend_index', self._recommend)
        self._action = PassesAction(self, self._plan)
        self._diagnostics = Diagnostics(self, {'index': self._status})

    def _load_files(self) -> None:
        self._model = model_from_parameters(self.values)
        self._path_publisher = self.create_publisher(Path, 'planned_path', topics.LATCHED)
        if self.values['mesh_file']:
            self._plan({})

    def close(self) -> None:
        self._action.close()

    def _selected_model(self) -> DepositionModel:
        """The model, with the brush of the parameters if there is one."""
        brush = self.values['brush']
        return self._model.with_brush(brush) if brush else self._model

    def _recommend(
        self, request: RecommendIndex.Request, response: RecommendIndex.Response
    ) -> RecommendIndex.Response:
        self._requests += 1
        values = self.values
        # In requests and parameters 0 stands for none.
        asked = {name: getattr(request, name) or None for name in REQUEST_FIELDS}
        try:
            index_request = IndexRequest(
                **asked,
                width_m=request.width_m or values['width_m'] or None,
                length_m=values['length_m'] or None,
                one_way=request.one_way,
                gun_turns=values['gun_turns'],
                standoff_m=values['standoff_m'] or None,
                travel_rad=values['travel_rad'],
            )
            answer = recommend(self._selected_model(), index_request)
        except (PaintError, MemoryError) as error:
            self._last = Status(WARN, str(error) or 'not enough memory')
            response.message = str(error)
            return response
        self._last = Status(OK, answer.sentence)
        return _fill_response(response, answer)

    def _plan(
        self, changed: Mapping[str, Any], progress: Progress = lambda stage, share: None
    ) -> tuple[Plan, Path]:
        """Plan passes, with some parameters replaced, and publish them."""
        values = self.values | dict(changed)
        if not values['mesh_file']:
            raise PlanError('mesh_file is empty: name the mesh of the part')
        progress('reading the mesh', 0.0)
        mesh_file = os.path.expanduser(values['mesh_file'])
        self.require_named_folder(mesh_file)
        surface = read_mesh(mesh_file, values['mesh_scale'], values['max_edge_length_m'])
        for note in surface.notes:
            self.get_logger().warning(note)
        request = PlanRequest(
            **{name: values[name] or None for name in OPTIONAL_PARAMETERS},
            **{name: values[name] for name in REQUIRED_PARAMETERS},
            outward=tuple(values['outward']) or None,
        )
        frame_id = values['frame_id'].lstrip('/')
        planned = plan(surface, self._selected_model(), request, frame_id, progress)
        self.get_logger().info(planned.sentence)
        path = _path_message(planned.trajectory, self.get_clock().now().nanoseconds)
        self._path_publisher.publish(path)
        return planned, path

    # --- parameters and diagnostics

    def _validate_change(self, values: Mapping[str, Any], names: set[str]) -> None:
        if 'model_file' in names:
            self._next_model = model_from_parameters(values)

    def _on_change(self, names: set[str]) -> None:
        if 'model_file' in names:
            self._model = self._next_model

    def _status(self) -> Status:
        values = {
            'model': self.values['model_file'] or 'a 50 mm bell',
            'effects': ' '.join(effect.id for effect in self._model.effects) or 'none',
            'requests': self._requests,
        }
        return Status(self._last.level, self._last.message, values)


def _fill_response(
    response: RecommendIndex.Response, answer: Recommendation
) -> RecommendIndex.Response:
    response.success = True
    response.message = '; '.join([answer.sentence, *answer.notes])
    for name in ('index_m', 'sigma_n', 'mean_um', 'speed_m_per_s', 'travel'):
        setattr(response, name, getattr(answer, name))
    for name in ('tolerance', 'cycle_time_s'):
        value = getattr(answer, name)
        setattr(response, name, math.nan if value is None else value)
    response.index_range_m = list(answer.index_range_m)
    response.window_low_m = [low for low, _ in answer.windows_m]
    response.window_high_m = [high for _, high in answer.windows_m]
    response.minima_index_m = [minimum.index_m for minimum in answer.minima]
    response.minima_sigma_n = [minimum.sigma_n for minimum in answer.minima]
    response.passes = answer.passes or 0
    response.curve_index_m = answer.curve.index_m.tolist()
    response.curve_sigma_n = answer.curve.sigma_n.tolist()
    none = math.nan, math.nan
    response.index_drift_low_m, response.index_drift_high_m = answer.index_drift_m or none
    response.standoff_drift_low_m, response.standoff_drift_high_m = answer.standoff_drift_m or none
    return response


def _path_message(trajectory: Trajectory, start_ns: int) -> Path:
    """Poses about SPACING_M apart, both ends included, with stamps from ``start_ns`` on."""
    step = np.linalg.norm(np.diff(trajectory.positions_m, axis=0), axis=1)
    travelled = np.floor(np.concatenate([[0.0], np.cumsum(step)]) / SPACING_M)
    kept = np.append(True, np.diff(travelled) > 0.0)
    kept[-1] = True
    stamps_ns = start_ns + trajectory.stamps_ns - trajectory.stamps_ns[0]
    message = Path(header=header(trajectory.frame_id, start_ns))
    for row in np.flatnonzero(kept):
        pose = PoseStamped(header=header(trajectory.frame_id, int(stamps_ns[row])))
        p, q = pose.pose.position, pose.pose.orientation
        p.x, p.y, p.z = trajectory.positions_m[row].tolist()
        q.x, q.y, q.z, q.w = trajectory.quaternions_xyzw[row].tolist()
        message.poses.append(pose)
    return message


class PassesAction:
    """The action server `plan_passes`, which executes one goal at a time, in a thread.

    A cancelled goal ends at the next report of progress. A PaintError aborts the goal and is the
    message of its result.
    """

    def __init__(self, node: PaintNode, plan_and_publish: PlanAndPublish) -> None:
        self._node, self._plan_and_publish = node, plan_and_publish
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix='plan_passes')
        self._closed = False
        self._server = ActionServer(
            node, PlanPasses, 'plan_passes', self._execute,
            callback_group=ReentrantCallbackGroup(),
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )  # fmt: skip

    def close(self) -> None:
        """Cancel the running goal and destroy the server."""
        self._closed = True
        self._thread.shutdown(cancel_futures=True)
        self._server.destroy()

    async def _execute(self, goal: ServerGoalHandle) -> PlanPasses.Result:
        reported_s, reported = 0.0, ''

        def progress(stage: str, share: float) -> None:
            nonlocal reported_s, reported
            if self._closed or goal.is_cancel_requested:
                raise CancelledError
            now_s = time.monotonic()
            if stage != reported or now_s - reported_s > FEEDBACK_PERIOD_S:
                reported_s, reported = now_s, stage
                goal.publish_feedback(PlanPasses.Feedback(stage=stage, share=float(share)))

        work = self._thread.submit(self._plan, goal.request, progress)
        try:
            result = await self._node.result_of(work)
        except CancelledError:
            goal.canceled()
            return PlanPasses.Result(message='cancelled')
        except (PaintError, MemoryError) as error:
            goal.abort()
            return PlanPasses.Result(message=str(error) or 'not enough memory')
        goal.succeed()
        return result

    def _plan(self, goal: PlanPasses.Goal, progress: Progress) -> PlanPasses.Result:
        progress('begin', 0.0)
        given = {name: getattr(goal, name) for name in GOAL_FIELDS if getattr(goal, name)}
        if 'target_um' in given and 'speed_m_per_s' not in given:
            given['speed_m_per_s'] = 0.0  # from the target, not from the parameter
        planned, path = self._plan_and_publish(given, progress)
        return PlanPasses.Result(
            success=True,
            message=planned.sentence,
            path=path,
            passes=len(planned.passes),
            index_m=planned.placement.index_m,
            speed_m_per_s=planned.style.speed_m_per_s,
            duration_s=planned.cycle_time_s,
            mean_um=planned.mean_um,
            sigma_n=planned.sigma_n,
        )
