"""The planner's long work as actions: passes on a part, and the diagnosis of a campaign."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from nav_msgs.msg import Path as PathMessage
from paint_msgs.action import Diagnose, PlanPasses
from rclpy.action.server import ActionServer, CancelResponse, ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup

from paint_deposition.errors import PaintError
from paint_deposition.nodes.planning.diagnosing import Progress, Task, diagnosed
from paint_deposition.nodes.runtime.node import PaintNode
from paint_deposition.nodes.runtime.parameters import require_file_name
from paint_deposition.planning.plan import Plan

FEEDBACK_PERIOD_S = 0.1

# Plans with other values of parameters, and publishes the passes.
PlanAndShow = Callable[[Mapping[str, Any], Progress], tuple[Plan, PathMessage]]


class Cancelled(Exception):
    """Whoever asked for the work does not want it any more."""


class LongWork:
    """An action server; its goals are worked off one after the other, in a thread.

    A goal that is cancelled ends where the work next reports its progress. A PaintError aborts
    it; the result then says why.

    Args:
        node: that offers it; its executor must run.
        action: the type. name: of the action.
        work: (goal, progress) -> the action's result, successful.
    """

    def __init__(
        self, node: PaintNode, action: Any, name: str, work: Callable[[Any, Progress], Any]
    ) -> None:
        self._node, self._action, self._work = node, action, work
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix=name)
        self._closed = False
        self._server = ActionServer(
            node,
            action,
            name,
            self._execute,
            callback_group=ReentrantCallbackGroup(),
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )

    def close(self) -> None:
        """Break off what is being done, and end the server."""
        self._closed = True
        self._thread.shutdown(cancel_futures=True)
        self._server.destroy()

    async def _execute(self, goal: ServerGoalHandle) -> Any:
        reported_s, reported = 0.0, ''

        def progress(stage: str, share: float) -> None:
            nonlocal reported_s, reported
            if self._closed or goal.is_cancel_requested:
                raise Cancelled
            now_s = time.monotonic()
            if stage != reported or now_s - reported_s > FEEDBACK_PERIOD_S:
                reported_s, reported = now_s, stage
                goal.publish_feedback(self._action.Feedback(stage=stage, share=float(share)))

        def work() -> Any:
            progress('begin', 0.0)
            return self._work(goal.request, progress)

        try:
            result = await self._node.in_a_thread(self._thread.submit(work))
        except Cancelled:
            goal.canceled()
            return self._action.Result(message='cancelled')
        except PaintError as error:
            goal.abort()
            return self._action.Result(message=str(error))
        goal.succeed()
        return result


class PlanningActions:
    """Offers the actions `plan_passes` and `diagnose`."""

    def __init__(self, node: PaintNode, plan_and_show: PlanAndShow) -> None:
        self._node, self._plan_and_show = node, plan_and_show
        self._actions = [
            LongWork(node, PlanPasses, 'plan_passes', self._plan_passes),
            LongWork(node, Diagnose, 'diagnose', self._diagnose),
        ]

    def close(self) -> None:
        """Break off what is being done."""
        for action in self._actions:
            action.close()

    def _plan_passes(self, goal: PlanPasses.Goal, progress: Progress) -> PlanPasses.Result:
        fields = {
            'mesh_file': os.path.expanduser(goal.mesh_file),
            'speed_m_per_s': goal.speed_m_per_s,
            'target_um': goal.target_um,
            'index_m': goal.index_m,
            'direction': goal.direction,
        }
        given = {name: value for name, value in fields.items() if value}
        if 'target_um' in given and 'speed_m_per_s' not in given:
            given['speed_m_per_s'] = 0.0  # the target chooses it, not the parameter
        planned, path = self._plan_and_show(given, progress)
        return PlanPasses.Result(
            success=True,
            message=planned.sentence,
            path=path,
            passes=len(planned.passes),
            index_m=planned.placing.index_m,
            speed_m_per_s=planned.style.speed_m_per_s,
            duration_s=planned.cycle_time_s,
            mean_um=planned.mean_um,
            sigma_n=planned.sigma_n,
        )

    def _diagnose(self, goal: Diagnose.Goal, progress: Progress) -> Diagnose.Result:
        values = self._node.values
        require_file_name('name', goal.name)
        folder = Path(values['output_directory']).expanduser().absolute() / goal.name
        if folder.exists():
            raise PaintError(f'{folder} is there already: choose another name')
        task = Task(
            os.path.expanduser(goal.campaign_file),
            os.path.expanduser(goal.model_file),
            folder,
            values['allow_user_effects'],
        )
        return Diagnose.Result(success=True, **diagnosed(task, progress))
