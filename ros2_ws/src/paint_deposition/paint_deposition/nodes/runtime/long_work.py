"""Work of seconds to minutes as a ROS action: in a thread, with feedback and cancel."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from rclpy.action.server import ActionServer, CancelResponse, ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup

from paint_deposition.errors import PaintError
from paint_deposition.nodes.runtime.paint_node import PaintNode

FEEDBACK_PERIOD_S = 0.1

# What is being done, and the share of it that is done, 0 to 1.
Tell = Callable[[str, float], None]
# (goal, tell) -> the action's result, successful.
Work = Callable[[Any, Tell], Any]


class Cancelled(Exception):
    """Whoever asked for the work does not want it any more."""


class LongWork:
    """An action server; its goals are worked off one after the other.

    A goal that is cancelled ends where the work next tells of its progress. A PaintError aborts
    it; the result then says why.

    Args:
        node: that offers it; its executor must run.
        action: the type. name: of the action.
        work: is called in a thread of its own.
    """

    def __init__(self, node: PaintNode, action: Any, name: str, work: Work) -> None:
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
        told_s, stage_told = 0.0, ''

        def tell(stage: str, share: float) -> None:
            nonlocal told_s, stage_told
            if self._closed or goal.is_cancel_requested:
                raise Cancelled
            now_s = time.monotonic()
            if stage != stage_told or now_s - told_s > FEEDBACK_PERIOD_S:
                told_s, stage_told = now_s, stage
                goal.publish_feedback(self._action.Feedback(stage=stage, share=float(share)))

        def work() -> Any:
            tell('begin', 0.0)
            return self._work(goal.request, tell)

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
