"""Flow and brush over time, from trigger changes that may come late or out of order."""

from bisect import bisect_right, insort
from operator import itemgetter

import numpy as np

from paint_deposition.motion.trigger import ONLY_BRUSH

_STAMP = itemgetter(0)


class FlowSchedule:
    """Flow relative to the calibrated one, and the brush, as functions of time.

    Before the first change the gun is off; without any change it always sprays.
    """

    def __init__(self) -> None:
        self._changes: list[tuple[int, float, int]] = []
        self._of_another_stream: list[tuple[int, float, int]] = []
        self._forgetful = False

    def __bool__(self) -> bool:
        return bool(self._changes)

    def add(
        self,
        stamp_ns: int,
        flow: float,
        brush: int = ONLY_BRUSH,
        another_stream: bool = False,
    ) -> None:
        """Set flow and brush from a time on.

        Args:
            stamp_ns: the time; of two changes at one time the later to come counts.
            flow: relative; 0 is gun off.
            brush: its number; it counts while the gun is on.
            another_stream: the change may belong to a stream that is about to restart.
        """
        change = (int(stamp_ns), float(flow), int(brush) if flow > 0.0 else ONLY_BRUSH)
        insort(self._changes, change, key=_STAMP)
        if another_stream:
            insort(self._of_another_stream, change, key=_STAMP)

    def steps(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times (C,) int64 of changes; flow and brush (C + 1,) before, between and after them."""
        if not self._changes:
            return np.empty(0, dtype=np.int64), np.ones(1), np.array([ONLY_BRUSH])
        last_at = {stamp: (flow, brush) for stamp, flow, brush in self._changes}
        stamps, set_to = np.array([*last_at], np.int64), [(0.0, ONLY_BRUSH), *last_at.values()]
        flows, brushes = np.array([f for f, _ in set_to]), np.array([b for _, b in set_to])
        changes = (np.diff(flows) != 0.0) | (np.diff(brushes) != 0)
        kept = np.append(True, changes)
        return stamps[changes], flows[kept], brushes[kept]

    def forget(self, until_ns: int) -> None:
        """Drop changes that no longer matter from a time on."""
        superseded = bisect_right(self._changes, until_ns, key=_STAMP) - 1
        if superseded > 0:
            del self._changes[:superseded]
            self._forgetful = True

    def restart(self) -> int:
        """Go back to the changes of a restarted stream; returns how many of them had come early.

        If none had, the gun is off until the next change, unless nothing was forgotten: then the
        changes of the whole recording are still there.
        """
        early, self._of_another_stream = self._of_another_stream, []
        if early:
            self._changes = early
        elif self._forgetful:
            self._changes = [(self._changes[0][0], 0.0, ONLY_BRUSH)]
        return len(early)
