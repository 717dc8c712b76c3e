"""The action server that plans passes on a part."""

import time
from collections.abc import Callable, Mapping
from concurrent.futures import CancelledError, ThreadPoolExecutor
from typing import Any

from nav_msgs.msg import Path
from paint_msgs.action import PlanPasses
from rclpy.action.server import ActionServer, CancelResponse, ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup

from paint_deposition.errors import PaintError
from paint_deposition.nodes.runtime.node import PaintNode
from paint_deposition.planning.plan import Plan

FEEDBACK_PERIOD_S = 0.1
# Fields of a goal that replace the parameters of the same names.
GOAL_FIELDS = ('mesh_file', 'speed_m_per_s', 'target_um', 'index_m', 'direction')

# (stage, share of it that is done, 0 to 1); it raises CancelledError to cancel the work.
Progress = Callable[[str, float], None]
# (parameters to replace, progress) -> plan, published path.
PlanAndPublish = Callable[[Mapping[str, Any], Progress], tuple[Plan, Path]]


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
