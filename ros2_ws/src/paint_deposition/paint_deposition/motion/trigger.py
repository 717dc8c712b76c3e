"""The trigger: the flow and the brush over time, and when the gun last opened and closed."""

import math
from bisect import bisect_right, insort
from operator import itemgetter

import numpy as np

from paint_deposition.errors import RecordingError
from paint_deposition.kernel.compiler import njit

# The brush of a motion that names none: the only one.
ONLY_BRUSH = 0
# Earlier than any stamp [ns].
BEFORE_ALL_NS = -(2**62)
_TIMES = ('dwell_s', 'since_on_s', 'since_off_s')
TRIGGER_STATE = np.dtype(
    [(name, 'f8') for name in ('flow', 'open_flow', *_TIMES)] + [('open_brush', 'i8')]
)

SPRAYS_NOTHING = (
    'says spraying with flow 0, which lays no paint: give 1 for the calibrated flow, or NaN where '
    'it is not measured'
)


def relative_flow(spraying: bool, flow: float = math.nan) -> float:
    """Flow relative to the calibrated one, 0 while the gun is off; NaN is unknown and taken as 1.

    Raises RecordingError for a flow that is negative or infinite.
    """
    if not spraying:
        return 0.0
    if math.isnan(flow):
        return 1.0
    if flow < 0.0 or math.isinf(flow):
        raise RecordingError(f'atomizer flow is {flow}: give 1 for the calibrated flow, or NaN')
    return float(flow)


def first_trigger(flow_before: float) -> np.ndarray:
    """State before the first sub-step: (1,) record, from the flow that was on until then."""
    return np.array([(flow_before, 1.0, 0.0, np.inf, np.inf, ONLY_BRUSH)], TRIGGER_STATE)


@njit(cache=True)
def follow_trigger(states, dwell, flow, brush, after_gap):
    """Measure back to the last opening and closing of the gun; a gap forgets them.

    ``states`` (1,) is updated in place; all others (M,): dwell [s], relative flow, 0 gun off,
    int64 brush, which counts where the gun is on, and after_gap.

    Returns:
        open_flow and open_brush (M,) of the opening that runs or ran last; since_on_s and
        since_off_s (M,) to the middle of the sub-step, inf where there is nothing to measure to.
    """
    count = len(dwell)
    open_flow, since_on, since_off = np.empty(count), np.empty(count), np.empty(count)
    open_brush = np.empty(count, np.int64)
    state = states[0]
    for i in range(count):
        if after_gap[i]:
            state.flow = 0.0
            state.since_on_s = state.since_off_s = np.inf
        elapsed = 0.5 * (state.dwell_s + dwell[i])
        state.since_on_s += elapsed
        state.since_off_s += elapsed
        if flow[i] > 0.0 and state.flow == 0.0:
            state.since_on_s = 0.5 * dwell[i]
        if flow[i] == 0.0 and state.flow > 0.0:
            state.since_off_s = 0.5 * dwell[i]
        if flow[i] > 0.0:
            state.open_flow, state.open_brush = flow[i], brush[i]
        state.flow, state.dwell_s = flow[i], dwell[i]
        open_flow[i], open_brush[i] = state.open_flow, state.open_brush
        since_on[i], since_off[i] = state.since_on_s, state.since_off_s
    return open_flow, open_brush, since_on, since_off


_STAMP = itemgetter(0)


class FlowSchedule:
    """Flow relative to the calibrated one, and the brush, as functions of time.

    Before the first change the gun is off; without any change it always sprays.
    """

    def __init__(self) -> None:
        self._changes: list[tuple[int, float, int]] = []
        self._of_another_stream: list[tuple[int, float, int]] = []

    def __bool__(self) -> bool:
        return bool(self._changes)

    def add(
        self, stamp_ns: int, flow: float, brush: int = ONLY_BRUSH, another_stream: bool = False
    ) -> None:
        """Set flow (relative; 0 is gun off) and brush from a time on.

        Of two changes at one time the later to come counts. ``another_stream``: the change waits,
        since it may belong to a stream that is about to restart.
        """
        change = (int(stamp_ns), float(flow), int(brush) if flow > 0.0 else ONLY_BRUSH)
        insort(self._of_another_stream if another_stream else self._changes, change, key=_STAMP)

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

    @property
    def waiting(self) -> list[int]:
        """Times of the changes that wait, in order."""
        return [stamp for stamp, *_ in self._of_another_stream]

    def go_on(self) -> list[int]:
        """The stream has not restarted: changes that waited are of this one; their times."""
        stamps, late = self.waiting, self._of_another_stream
        self._of_another_stream = []
        for change in late:
            insort(self._changes, change, key=_STAMP)
        return stamps

    def restart(self, ended_ns: int | None) -> None:
        """Go over to a restarted stream, and the changes that waited for it.

        Until the first of them the gun stays as it was when the stream before ended, at
        ``ended_ns``, if the clock was set back in its midst; None: a replay, off until then.
        """
        early, self._of_another_stream = self._of_another_stream, []
        if not self._changes:
            self._changes = early
            return
        passed = bisect_right(self._changes, ended_ns, key=_STAMP) if ended_ns is not None else 0
        _, flow, brush = self._changes[passed - 1] if passed else (0, 0.0, ONLY_BRUSH)
        self._changes = [(BEFORE_ALL_NS, flow, brush), *early]
