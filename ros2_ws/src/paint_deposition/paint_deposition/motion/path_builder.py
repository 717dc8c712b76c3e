"""From a stream of poses to the spray path: the one integrator of live node and offline run.

Of a recorded motion it is said what is wrong with it: nothing moves or sprays, it breaks off or
begins again.
"""

from bisect import bisect_right, insort
from collections.abc import Iterator
from itertools import pairwise
from operator import itemgetter
from typing import NoReturn

import numpy as np

from paint_deposition.errors import RecordingError
from paint_deposition.motion import strokes
from paint_deposition.motion.path import SprayPath, split_segments, thin_poses
from paint_deposition.motion.pose_stream import PoseBatch, PoseScreen, TriggerChange, events_of
from paint_deposition.motion.stream_quality import MANY_REPEATED
from paint_deposition.motion.trajectory import (
    BEFORE_ALL_NS,
    DEFAULT_MAX_POSE_GAP_S,
    ONLY_BRUSH,
    PoseCounts,
    Trajectory,
    gap_ns,
)

DEFAULT_MAX_STEP_M = 0.008
_STAMP = itemgetter(0)


class PathBuilder:
    """Screens poses as they come and turns them into sub-steps.

    Feed it in any batches: the sub-steps depend on the poses and trigger changes alone.
    ``PoseScreen`` says which poses are dropped and when a stream counts as restarted; that is
    followed as after a gap. A time between poses longer than ``max_pose_gap_s`` is gun off; the
    spray travels ``max_step_m`` at most in a sub-step. With ``whole_strokes`` a stroke is handed
    out when it is complete, with what lies ahead of each sub-step known. ``knows_all_changes``:
    the changes of the trigger come before the poses, and hold for each restarted stream. Of
    ``screen`` are the counts of poses and the newest that was kept.
    """

    def __init__(
        self,
        max_pose_gap_s: float = DEFAULT_MAX_POSE_GAP_S,
        max_step_m: float = DEFAULT_MAX_STEP_M,
        whole_strokes: bool = False,
        knows_all_changes: bool = False,
    ) -> None:
        self._knows_all_changes = knows_all_changes
        self.max_gap_ns = gap_ns(max_pose_gap_s)
        self.max_step_m = max_step_m
        self.whole_strokes = whole_strokes
        self.screen = PoseScreen(self.max_gap_ns)
        # Stamp, flow and brush of changes of the trigger, in order; and of those that may belong
        # to a stream that is about to restart.
        self._changes: list[tuple[int, float, int]] = []
        self._waiting_changes: list[tuple[int, float, int]] = []
        self._waiting: list[PoseBatch] = []
        self._integrated_ns: int | None = None
        # The stream has not restarted once its stamps are beyond; see ``add_trigger``.
        self._restart_until_ns = 0
        self._finished: list[SprayPath] = []
        self._gap_before_next = False
        self._states: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
        self._began_ns: int | None = None
        # First stamp of the stream.
        self._stream_ns: int | None = None

    def add_trigger(self, stamp_ns: int, flow: float, brush: int = ONLY_BRUSH) -> None:
        """Change the flow (relative; 0 is gun off) and the brush at a time.

        Before the first change the gun is off; without any it always sprays. Of two at one time
        the later to come counts. A change that comes after the path beyond it was handed out is
        counted and takes effect from there on. One from before the newest pose by more than a gap,
        or after poses that wait behind that, waits as long, and the path with it: it is a late one
        if the stream goes on, and one of the restarted stream if that comes.
        """
        newest_ns, behind = self.screen.newest_ns, self.screen.behind.stamps_ns
        newest_ns = int(stamp_ns) if newest_ns is None else newest_ns
        waits = newest_ns - int(stamp_ns) > self.max_gap_ns
        waits |= bool(len(behind)) and behind[0] <= int(stamp_ns) < newest_ns
        if waits:
            self._restart_until_ns = newest_ns + self.max_gap_ns
        elif self._integrated_ns is not None:
            self.screen.counts.late_triggers += int(stamp_ns) < self._integrated_ns
        change = int(stamp_ns), float(flow), int(brush) if flow > 0.0 else ONLY_BRUSH
        insort(self._waiting_changes if waits else self._changes, change, key=_STAMP)

    def add_poses(self, batch: PoseBatch) -> None:
        """Take poses."""
        continued, *restarted = self.screen.take(batch)
        self._waiting.append(continued)
        if self._stream_ns is None and len(continued):
            self._stream_ns = int(continued.stamps_ns[0])
        if len(continued) and continued.stamps_ns[-1] > self._restart_until_ns:
            # The stream has not restarted: changes that waited for that are of this one.
            for change in self._waiting_changes:
                insort(self._changes, change, key=_STAMP)
                is_late = self._integrated_ns is not None and change[0] < self._integrated_ns
                self.screen.counts.late_triggers += is_late
            self._waiting_changes = []
        for stream in restarted:
            ended_ns = int(PoseBatch.joined(self._waiting).stamps_ns[-1])
            within = self._stream_ns is not None and stream.stamps_ns[0] > self._stream_ns
            self._stream_ns = int(stream.stamps_ns[0])
            self._cut_segments(until_ns=None, finish=True)
            if not self._knows_all_changes:
                # Until its first change the gun stays as it was when the stream before ended, if
                # the clock was set back in its midst; in a replay it is off until then.
                if self._changes:
                    passed = bisect_right(self._changes, ended_ns, key=_STAMP) if within else 0
                    _, flow, brush = self._changes[passed - 1] if passed else (0, 0.0, ONLY_BRUSH)
                    self._waiting_changes.insert(0, (BEFORE_ALL_NS, flow, brush))
                self._changes, self._waiting_changes = self._waiting_changes, []
            self._integrated_ns = self._began_ns = None
            self._gap_before_next = True
            self._waiting = [stream]

    def take(self, until_ns: int | None = None, finish: bool = False) -> SprayPath:
        """Hand out the sub-steps that are complete, without poses later than ``until_ns``.

        ``finish``: the stream has ended; the poses behind the last that was followed, and
        incomplete strokes, are handed out too.
        """
        # Of a restart that was about to come nothing is left, nor of its changes, which wait on.
        if finish:
            self.screen.finish()
        self._cut_segments(until_ns, finish)
        if self._integrated_ns is not None:  # of the changes until there the last still counts
            passed = bisect_right(self._changes, self._integrated_ns, key=_STAMP)
            del self._changes[: max(passed - 1, 0)]
        path = SprayPath.joined([SprayPath.empty(), *self._finished])
        self._finished = []
        if not (self.whole_strokes and len(path)):
            return path
        stroke = path.stroke
        ready = len(path) if finish else int(np.searchsorted(stroke, stroke[-1], side='left'))
        # The last stroke's end shows with the first row of the next, which the look ahead needs.
        until_on, until_off, to_turn = strokes.look_ahead(
            stroke, path.velocity_m_per_s, path.dwell_s, path.flow, path.since_on_s,
            path.from_turn_m,
        )  # fmt: skip
        complete = path.with_(until_on_s=until_on, until_off_s=until_off, to_turn_m=to_turn)
        self._finished = [path.select(slice(ready, None))]
        return complete.select(slice(0, ready))

    def _cut_segments(self, until_ns: int | None, finish: bool) -> None:
        if not self._waiting:
            return
        poses = PoseBatch.joined(self._waiting)
        self._waiting = [poses]
        ready = len(poses)
        if self._waiting_changes and not finish:
            first_ns = self._waiting_changes[0][0]
            until_ns = min(first_ns, until_ns or first_ns)
        if until_ns is not None:
            ready = int(np.searchsorted(poses.stamps_ns, until_ns, side='right'))
        if ready < 2:
            return
        come = poses.select(slice(0, ready))
        rows = thin_poses(
            come.stamps_ns, come.positions_m, come.quaternions_xyzw, self.max_gap_ns,
            self.max_step_m,
        )  # fmt: skip
        if finish and rows[-1] < ready - 1:
            rows = np.append(rows, ready - 1)
        if len(rows) < 2:
            return
        # Times (C,) of changes of the trigger; flow and brush (C + 1,) before and after each.
        last_at = {stamp: (flow, brush) for stamp, flow, brush in self._changes}
        before = (0.0 if last_at else 1.0, ONLY_BRUSH)
        flows, brushes = map(np.array, zip(before, *last_at.values(), strict=True))
        changes = (np.diff(flows) != 0.0) | (np.diff(brushes) != 0)
        kept = np.append(True, changes)
        cuts, flows, brushes = np.array([*last_at], np.int64)[changes], flows[kept], brushes[kept]
        now = come.select(rows)
        stamp, dwell, position, rotation, velocity, after_gap = split_segments(
            now.stamps_ns, now.positions_m, now.quaternions_xyzw, cuts, self.max_gap_ns,
            self.max_step_m,
        )  # fmt: skip
        if len(stamp):
            after_gap[0] |= self._gap_before_next
            self._gap_before_next = False
            change = np.searchsorted(cuts, stamp, side='right')
            path = SprayPath.of(stamp, dwell, flows[change], position, rotation, velocity)
            path = path.with_(brush=brushes[change])
            self._finished.append(self._with_strokes_and_passes(path, after_gap, flows[0]))
        # A gap at the end of this batch must be seen by the next one.
        last_step_ns = now.stamps_ns[-1] - now.stamps_ns[-2]
        self._gap_before_next = bool(last_step_ns > self.max_gap_ns)
        self._integrated_ns = int(now.stamps_ns[-1])
        self._waiting = [poses.select(slice(int(rows[-1]), None))]

    def _with_strokes_and_passes(
        self, path: SprayPath, after_gap: np.ndarray, flow_before: float
    ) -> SprayPath:
        """The path with its strokes and passes, and what lies behind each sub-step."""
        if self._states is None:
            self._states = strokes.first_states(flow_before)
            after_gap[0] = False  # Nothing came before the first.
        of_stroke, of_pass, of_trigger = self._states
        position, normal = path.position_m, path.rotation[:, :, 2]
        stroke, from_turn, heading, step = strokes.follow_strokes(
            of_stroke, position, normal, path.velocity_m_per_s, path.dwell_s, after_gap
        )
        spray_pass = strokes.follow_passes(
            of_pass, position, normal, heading, step, path.flow, after_gap
        )
        open_flow, open_brush, since_on, since_off = strokes.follow_trigger(
            of_trigger, path.dwell_s, path.flow, path.brush, after_gap
        )
        if self._began_ns is None:
            self._began_ns = int(path.stamp_ns[0])
        return path.with_(
            time_s=(path.stamp_ns - self._began_ns) * 1e-9, stroke=stroke, spray_pass=spray_pass,
            passes_before=np.maximum(spray_pass, 0), open_flow=open_flow, since_on_s=since_on,
            since_off_s=since_off, from_turn_m=from_turn, brush=open_brush,
        )  # fmt: skip


def spray_path(
    trajectory: Trajectory,
    max_pose_gap_s: float = DEFAULT_MAX_POSE_GAP_S,
    max_step_m: float = DEFAULT_MAX_STEP_M,
    whole_strokes: bool = True,
) -> tuple[SprayPath, PoseCounts]:
    """Screen a whole recording and cut it into sub-steps; also returns what was dropped."""
    builder = PathBuilder(
        max_pose_gap_s, max_step_m, whole_strokes, not len(trajectory.trigger_rows)
    )
    for event in events_of(trajectory):
        if isinstance(event, TriggerChange):
            builder.add_trigger(event.stamp_ns, event.flow, event.brush)
        else:
            builder.add_poses(event)
    return builder.take(finish=True), builder.screen.counts


def checked_path(
    trajectory: Trajectory, max_pose_gap_s: float, max_step_m: float = DEFAULT_MAX_STEP_M
) -> tuple[SprayPath, PoseCounts, tuple[str, ...]]:
    """``spray_path`` of a recording, what was dropped, and warnings of ``interruptions``.

    Raises RecordingError, saying why, for one without a single sub-step or along which the gun
    never sprays.
    """
    path, counts = spray_path(trajectory, max_pose_gap_s, max_step_m)
    if not len(path):
        _refuse_motion(trajectory, counts, max_pose_gap_s)
    if not np.any(path.flow > 0.0):
        opened = trajectory.trigger_flow > 0.0
        remedy = 'check --state-topic; without a trigger the gun sprays whenever poses flow'
        if not np.any(opened):
            raise RecordingError(
                f'{trajectory.source}: the gun never sprays, none of the {len(opened)} messages '
                f'of its trigger opens it; {remedy}'
            )
        opened_ns = trajectory.trigger_stamps_ns[np.argmax(opened)]
        apart_s = 1e-9 * float(opened_ns - trajectory.stamps_ns.min())
        raise RecordingError(
            f'{trajectory.source}: the gun never sprays while there are poses, its trigger first '
            f'opens {abs(apart_s):.3g} s {"after" if apart_s > 0.0 else "before"} the first of '
            f'them: check that both are stamped by one clock; {remedy}'
        )
    odd = list(interruptions(path, max_pose_gap_s))
    if counts.repeated_stamps > MANY_REPEATED * counts.received:
        odd.append(
            f'{counts.repeated_stamps} of {counts.received} poses dropped, for they repeat the '
            'stamp before them: the stamps look rounded, or poses recorded twice; record stamps '
            'with all their digits'
        )
    return path, counts, tuple(odd)


def interruptions(path: SprayPath, max_pose_gap_s: float) -> Iterator[str]:
    """Yield a warning of gaps while the gun sprayed, and one of streams that began again.

    Args:
        path: of one gun, in the order of the recording.
        max_pose_gap_s: a longer time between two poses counts as gun off [s].
    """
    half_ns = np.rint(0.5e9 * path.dwell_s).astype(np.int64)
    begin, end = path.stamp_ns - half_ns, path.stamp_ns + half_ns
    between = begin[1:] - end[:-1]
    sprays = path.flow > 0.0
    # The halves of two sub-steps are rounded, each to a nanosecond.
    (gaps,) = np.nonzero((between > gap_ns(max_pose_gap_s) - 4) & sprays[1:] & sprays[:-1])
    if len(gaps):
        longest = gaps[np.argmax(between[gaps])]
        flow = 0.5 * (path.flow[gaps] + path.flow[gaps + 1])
        missing = 1e-9 * float(between[gaps] @ flow) / path.spraying_time_s
        count = 'a gap' if len(gaps) == 1 else f'{len(gaps)} gaps'
        yield (
            f'{count} in the poses while the gun sprayed, {1e-9 * between[gaps].sum():.2f} s in '
            f'all, the longest {1e-9 * between[longest]:.2f} s from {_place(path, longest)} to '
            f'{_place(path, longest + 1)}: taken as gun off; if it sprayed there, '
            f'{100.0 * missing:.1f} % more paint was sprayed than is computed: record without '
            'gaps, or see --max-pose-gap-s (max_pose_gap_s in a campaign)'
        )
    (back,) = np.nonzero(np.diff(path.stamp_ns) < 0)
    for before, row in pairwise([*(back + 1), len(path)]):
        again = path.select(slice(before, row))
        share = again.spraying_time_s / path.spraying_time_s
        first = path.select(slice(0, len(again)))
        twice = np.array_equal(first.stamp_ns, again.stamp_ns) and np.array_equal(
            first.position_m, again.position_m
        )
        cause = 'another run follows in the file'
        if twice:
            cause = 'the same poses come again, as if the log were in the file twice'
        yield (
            f'the stamps start again at {_place(path, before)}: a second coat, '
            f'{100.0 * share:.1f} % of the paint; {cause}: keep one of them if it is not so'
        )


def _place(path: SprayPath, row: int) -> str:
    x, y, z = path.position_m[row]
    return f'({x:.2f}, {y:.2f}, {z:.2f}) m'


def _refuse_motion(trajectory: Trajectory, counts: PoseCounts, max_pose_gap_s: float) -> NoReturn:
    """Say what became of the poses."""
    reasons = {
        'not finite': counts.not_finite,
        'without a unit quaternion': counts.not_unit_quaternions,
        'with a repeated stamp': counts.repeated_stamps,
        'with a backward stamp': counts.backward_stamps,
        f'after a gap of more than {max_pose_gap_s:g} s': counts.gaps,
    }
    found = ', '.join(f'{count} {what}' for what, count in reasons.items() if count)
    remedy = 'record again, or see --max-pose-gap-s'
    if counts.gaps:
        apart_s = 1e-9 * float(np.median(np.abs(np.diff(trajectory.stamps_ns))))
        if apart_s <= 1e3 * max_pose_gap_s:
            remedy = (
                f'they are {apart_s:.3g} s apart: if these are milliseconds, give the unit in the '
                f'heading, as in time [ms]; else {remedy}'
            )
    raise RecordingError(
        f'{trajectory.source}: no two of its {counts.received} poses make a motion'
        f'{f" ({found})" if found else ""}; {remedy}'
    )
