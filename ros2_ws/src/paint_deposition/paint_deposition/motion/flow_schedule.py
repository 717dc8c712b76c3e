"""Flow over time, from trigger changes that may come late or out of order."""

from bisect import bisect_right, insort
from operator import itemgetter

import numpy as np

_STAMP = itemgetter(0)


class FlowSchedule:
    """Flow relative to the calibrated one as a function of time.

    Before the first change the gun is off; without any change it always sprays.
    """

    def __init__(self) -> None:
        self._changes: list[tuple[int, float]] = []
        self._of_another_stream: list[tuple[int, float]] = []
        self._forgetful = False

    def __bool__(self) -> bool:
        return bool(self._changes)

    def add(self, stamp_ns: int, flow: float, another_stream: bool = False) -> None:
        """Set the flow from a time on.

        Args:
            stamp_ns: the time; of two changes at one time the later to come counts.
            flow: relative; 0 is gun off.
            another_stream: the change may belong to a stream that is about to restart.
        """
        change = (int(stamp_ns), float(flow))
        insort(self._changes, change, key=_STAMP)
        if another_stream:
            insort(self._of_another_stream, change, key=_STAMP)

    def steps(self) -> tuple[np.ndarray, np.ndarray]:
        """Times (C,) int64 at which the flow changes; flow (C + 1,) before, between and after."""
        if not self._changes:
            return np.empty(0, dtype=np.int64), np.ones(1)
        last_at = dict(self._changes)
        stamps, flows = np.array([*last_at], np.int64), np.array([0.0, *last_at.values()])
        changes = np.diff(flows) != 0.0
        return stamps[changes], np.append(0.0, flows[1:][changes])

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
            self._changes = [(self._changes[0][0], 0.0)]
        return len(early)
