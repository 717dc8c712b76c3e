"""Node `index_planner`: recommends the index between passes, and plans passes on a part."""

import math
import os
import time
from collections.abc import Callable, Mapping
from concurrent.futures import CancelledError, ThreadPoolExecutor
from typing import Any

import numpy as np
from nav_msgs.msg import Path
from paint_msgs.action import PlanPasses
from paint_msgs.srv import RecommendIndex
from rclpy.action.server import ActionServer, CancelResponse, ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from scipy.spatial.transform import Rotation

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import PaintError
from paint_deposition.files.meshes import read_mesh
from paint_deposition.model.eq1_pattern import MOST
from paint_deposition.nodes import topics
from paint_deposition.nodes.node import OK, WARN, PaintNode, Status, Task
from paint_deposition.nodes.painting.painting_parameters import (
    model_from_parameters,
    model_parameters,
)
from paint_deposition.nodes.parameters import (
    NodeParameter,
    direction_parameter,
    fixed,
    mesh_parameters,
    requested,
)
from paint_deposition.nodes.topics import header, pose_message
from paint_deposition.planning.joints import rows_apart
from paint_deposition.planning.plan import Plan, kept_clear, plan
from paint_deposition.planning.recommendation import recommend
from paint_deposition.planning.requests import GunEnvelope, IndexRequest, PlanRequest

# (stage, share of it that is done, 0 to 1); it raises CancelledError to cancel the work.
Progress = Callable[[str, float], None]


class IndexPlanner(PaintNode):
    """Provides `recommend_index` and `plan_passes`; with a mesh, plans passes at the start.

    The planned motion is published on `planned_path`, latched, in the frame of the mesh.
    """

    NAME = 'index_planner'
    PARAMETERS = model_parameters('') | dict(
        brush=NodeParameter(
            0,
            'Number of the brush to plan for, of a model with several; 0: the only one [-]',
            (0, MOST),
        ),
        width_m=requested(IndexRequest, 'width_m', none='only that of a request'),
        length_m=requested(IndexRequest, 'length_m'),
        standoff_m=requested(PlanRequest, 'standoff_m'),
        travel_rad=requested(PlanRequest, 'travel_rad'),
        gun_turns=requested(IndexRequest, 'gun_turns', False),
        **fixed(
            'passes are planned once, when the node starts; restart the node with the new value',
            **mesh_parameters(max_edge_length_m=0.02),
            direction=requested(PlanRequest, 'direction', 'horizontal'),
            speed_m_per_s=requested(PlanRequest, 'speed_m_per_s', 0.3, none='from target_um'),
            target_um=requested(PlanRequest, 'target_um', none='none'),
            index_m=requested(PlanRequest, 'index_m'),
            smoothing_radius_m=requested(PlanRequest, 'smoothing_radius_m', 0.1),
            acceleration_m_per_s2=requested(PlanRequest, 'acceleration_m_per_s2', 2.0),
            outward=direction_parameter(
                'Direction from the part to the gun, any length; empty: the mean normal [-]'
            ),
        ),
    )

    def _configure(self) -> Mapping[str, Task]:
        self._model = model_from_parameters(self.values)
        self._path_publisher = self.create_publisher(Path, 'planned_path', topics.LATCHED)
        if self.values['mesh_file']:
            self._plan({})
        self._requests = 0
        self._last = OK, 'no request yet'
        self.create_service(RecommendIndex, 'recommend_index', self._recommend)
        self._planning = ThreadPoolExecutor(max_workers=1, thread_name_prefix='plan_passes')
        self._closed = False
        self._action = ActionServer(
            self, PlanPasses, 'plan_passes', self._execute,
            callback_group=ReentrantCallbackGroup(),
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )  # fmt: skip
        return {'index': self.status}

    def close(self) -> None:
        """Cancel the goal that is under way, and destroy the action server."""
        self._closed = True
        self._planning.shutdown(cancel_futures=True)
        self._action.destroy()

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
        asked = {
            name: getattr(request, name) or None
            for name in ('speed_m_per_s', 'target_um', 'index_min_m', 'index_max_m', 'tolerance')
        }
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
            self._last = WARN, str(error) or 'not enough memory'
            _, response.message = self._last
            return response
        self._last = OK, answer.sentence
        response.success = True
        response.message = '; '.join([answer.sentence, *answer.notes])
        for name in ('index_m', 'sigma_n', 'mean_um', 'speed_m_per_s', 'travel'):
            setattr(response, name, getattr(answer, name))
        known = {'tolerance': index_request.tolerance, 'cycle_time_s': answer.cycle_time_s}
        for name, value in known.items():
            setattr(response, name, math.nan if value is None else value)
        response.index_range_m = list(answer.index_range_m)
        response.window_low_m = [low for low, _ in answer.windows_m]
        response.window_high_m = [high for _, high in answer.windows_m]
        response.minima_index_m = [index_m for index_m, _ in answer.curve.minima]
        response.minima_sigma_n = [sigma_n for _, sigma_n in answer.curve.minima]
        response.passes = answer.passes or 0
        response.curve_index_m = answer.curve.index_m.tolist()
        response.curve_sigma_n = answer.curve.sigma_n.tolist()
        for name in ('index_drift', 'standoff_drift'):
            low, high = getattr(answer, f'{name}_m') or (math.nan, math.nan)
            setattr(response, f'{name}_low_m', low)
            setattr(response, f'{name}_high_m', high)
        return response

    def _plan(
        self, changed: Mapping[str, Any], progress: Progress = lambda stage, share: None
    ) -> tuple[Plan, Path]:
        """Plan passes, with some parameters replaced, and publish them."""
        values = self.values | dict(changed)
        if not values['mesh_file']:
            raise PaintError('mesh_file is empty: name the mesh of the part')
        progress('reading the mesh', 0.0)
        mesh_file = os.path.expanduser(values['mesh_file'])
        self.require_named_folder(mesh_file)
        surface = read_mesh(mesh_file, values['mesh_scale'], values['max_edge_length_m'])
        for note in surface.notes:
            self.get_logger().warning(note)
        # In requests and parameters 0 stands for none.
        given_or_not = ('speed_m_per_s', 'target_um', 'index_m', 'standoff_m')
        always = ('direction', 'smoothing_radius_m', 'acceleration_m_per_s2', 'travel_rad')
        request = PlanRequest(
            **{name: values[name] or None for name in given_or_not},
            **{name: values[name] for name in always},
            outward=tuple(values['outward']) or None,
        )
        frame_id = values['frame_id'].lstrip('/')
        planned = kept_clear(
            plan(surface, self._selected_model(), request, frame_id, progress), GunEnvelope()
        )
        self.get_logger().info(planned.sentence)
        for warning in planned.warnings:
            self.get_logger().warning(warning)
        motion, now_ns = planned.trajectory, self.get_clock().now().nanoseconds
        stamps_ns = now_ns + motion.stamps_ns - motion.stamps_ns[0]
        poses = np.hstack([motion.positions_m, motion.quaternions_xyzw])
        turns = Rotation.from_quat(motion.quaternions_xyzw)
        path = Path(header=header(frame_id, now_ns))
        for row in rows_apart(motion.positions_m, turns, step_m=0.02, step_rad=math.inf):
            path.poses.append(pose_message(frame_id, int(stamps_ns[row]), poses[row]))
        self._path_publisher.publish(path)
        return planned, path

    async def _execute(self, goal: ServerGoalHandle) -> PlanPasses.Result:
        """Plan in a thread, one goal at a time; a cancelled one ends at its next progress."""
        reported_s, reported = 0.0, ''

        def progress(stage: str, share: float) -> None:
            nonlocal reported_s, reported
            if self._closed or goal.is_cancel_requested:
                raise CancelledError
            now_s = time.monotonic()
            if stage != reported or now_s - reported_s > 0.1:
                reported_s, reported = now_s, stage
                goal.publish_feedback(PlanPasses.Feedback(stage=stage, share=float(share)))

        def work() -> tuple[Plan, Path]:
            progress('begin', 0.0)
            fields = ('mesh_file', 'speed_m_per_s', 'target_um', 'index_m', 'direction')
            goals = {name: getattr(goal.request, name) for name in fields}
            given = {name: value for name, value in goals.items() if value}
            if 'target_um' in given:  # the speed is for it, not that of the parameter
                given.setdefault('speed_m_per_s', 0.0)
            return self._plan(given, progress)

        try:
            planned, path = await self.result_of(self._planning.submit(work))
        except CancelledError:
            goal.canceled()
            return PlanPasses.Result(message='cancelled')
        except (PaintError, OSError, MemoryError) as error:
            goal.abort()
            return PlanPasses.Result(message=str(error) or 'not enough memory')
        goal.succeed()
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

    # --- parameters and diagnostics

    def _validate(self, values: Mapping[str, Any], changed: set[str]) -> None:
        if 'model_file' in changed:
            self._next_model = model_from_parameters(values)

    def _on_change(self, names: set[str]) -> None:
        if 'model_file' in names:
            self._model = self._next_model

    def status(self) -> Status:
        values = {
            'model': self.values['model_file'] or 'a 50 mm bell',
            'effects': ' '.join(effect.id for effect in self._model.effects) or 'none',
            'requests': self._requests,
        }
        return *self._last, values
