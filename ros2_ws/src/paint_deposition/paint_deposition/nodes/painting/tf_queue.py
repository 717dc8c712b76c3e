"""Poses that came before the transform that brings them into the part's frame."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from geometry_msgs.msg import PoseStamped

# A transform comes on another topic than the poses and is often some milliseconds late, a static
# one a little after the start; one that is not there after so long will not come.
TIMEOUT_S = 0.5
LONGEST = 5000


class NoTransform(Exception):
    """There is no transform for a pose; `may_come` tells whether waiting can help."""

    def __init__(self, reason: str, may_come: bool = False) -> None:
        super().__init__(reason)
        self.may_come = may_come


class TfQueue:
    """A queue of poses that leave it in the order in which they came, at most `TIMEOUT_S` late.

    A pose without a transform holds back all behind it. It is refused when its transform cannot
    come, has not come in time, or more than `LONGEST` poses wait.
    """

    def __init__(self) -> None:
        self._waiting: deque[tuple[float, PoseStamped]] = deque()

    def __len__(self) -> int:
        return len(self._waiting)

    def add(self, pose: PoseStamped, now_s: float) -> None:
        """Queue a pose that came just now, in monotonic seconds."""
        self._waiting.append((now_s, pose))

    def release(
        self,
        now_s: float,
        place: Callable[[PoseStamped], None],
        refuse: Callable[[PoseStamped, NoTransform], None],
    ) -> None:
        """Place what can be placed; `place` raises NoTransform for what cannot be yet."""
        while self._waiting:
            since_s, pose = self._waiting[0]
            try:
                place(pose)
            except NoTransform as missing:
                in_time = now_s - since_s < TIMEOUT_S and len(self._waiting) <= LONGEST
                if missing.may_come and in_time:
                    return
                refuse(pose, missing)
            self._waiting.popleft()

    def clear(self) -> None:
        """Forget all poses."""
        self._waiting.clear()
