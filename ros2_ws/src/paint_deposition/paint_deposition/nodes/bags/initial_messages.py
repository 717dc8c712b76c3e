"""The messages with which a run begins: what is in force, and what came for its part already."""

import math
from bisect import bisect_right
from collections import deque
from collections.abc import Mapping
from operator import attrgetter
from typing import NamedTuple

from geometry_msgs.msg import TransformStamped
from paint_msgs.msg import AtomizerState, Part
from rcl_interfaces.msg import ParameterEvent
from rclpy.serialization import deserialize_message

from paint_deposition.errors import RecordingError
from paint_deposition.files.recordings.messages import stamp_ns, trigger_change
from paint_deposition.film.live_film import STREAM_RESTART_NS
from paint_deposition.motion.part_frame import Rigid, is_pose
from paint_deposition.nodes.bags.recorded_topic import PARAMETER_EVENTS, STATIC_TF
from paint_deposition.nodes.runtime.topics import header_stamp_ns

# Of each topic of a gun, for the time in which a simulator reads the mesh of the next part.
REMEMBERED_MESSAGES = 20_000
TF = '/tf'
CLOSED = -1


class Recorded(NamedTuple):
    """A serialised message, when it was logged and sent; its stamp if it moves a gun, and the
    brush of a state that opens it.
    """

    topic: str
    cdr: bytes
    log_time_ns: int
    sent_ns: int
    stamp_ns: int = 0
    brush: int = CLOSED


class InitialMessages:
    """Remembers what later runs need: poses and states, part pose, transforms, parameters.

    Args:
        guns: topic of the states by that of the poses, of each gun.
        part_pose: topic of the part's pose.

    Attributes:
        begin_ns: log time of the first message of the run.
    """

    def __init__(self, guns: Mapping[str, str], part_pose: str) -> None:
        self._guns, self._part_pose = guns, part_pose
        self._motion: dict[str, deque[Recorded]] = {
            topic: deque(maxlen=REMEMBERED_MESSAGES) for gun in guns.items() for topic in gun
        }
        self._states_of = {topic: gun[1] for gun in guns.items() for topic in gun}
        # The last pose of each gun that was forgotten.
        self._forgotten = {poses: Recorded(poses, b'', 0, 0) for poses in guns}
        # Stamp of each gun's newest pose, or of the first state of a stream about to restart, by
        # the topic of its states.
        self._reached_ns: dict[str, int] = {}
        self.begin_ns = 0
        # Topics of states that this run does not have yet.
        self._due: set[str] = set()
        self._placed: deque[Recorded] = deque(maxlen=REMEMBERED_MESSAGES)
        self._transforms: deque[Recorded] = deque(maxlen=REMEMBERED_MESSAGES)
        self._lasting: dict[object, Recorded] = {}

    def add(self, topic: str, cdr: bytes, log_time_ns: int, sent_ns: int) -> list[Recorded]:
        """Remember a message if a later run may need it; what the run has to hold before it."""
        message = Recorded(topic, cdr, log_time_ns, sent_ns)
        if topic in self._motion:
            message = message._replace(stamp_ns=header_stamp_ns(cdr))
            if topic in self._guns:
                states = self._states_in_force(message)
                self._motion[topic].append(message)
                if message.stamp_ns:
                    self._reached_ns[self._guns[topic]] = message.stamp_ns
                return states
            try:
                change = trigger_change(deserialize_message(cdr, AtomizerState))
            except RecordingError:  # whoever paints refuses it, too
                return []
            if change.flow > 0.0:
                message = message._replace(brush=change.brush)
            states = self._states_in_force(message)
            self._remember_state(message)
            return states
        if topic == self._part_pose:
            self._placed.append(message)
        elif topic == TF:
            self._transforms.append(message)
            while self._transforms[0].sent_ns < sent_ns - 10_000_000_000:  # as in tf2
                self._transforms.popleft()
        elif topic == PARAMETER_EVENTS:
            event = deserialize_message(cdr, ParameterEvent)
            changed = (*event.new_parameters, *event.changed_parameters)
            self._replace((event.node, *(parameter.name for parameter in changed)), message)
        elif topic == STATIC_TF:
            self._replace(cdr, message)
        return []

    def begin_part(self, part: Part, sent_ns: int) -> tuple[int, dict[str, int]]:
        """Forget what only the parts before needed.

        Args:
            part: as a simulator announced it; header.stamp is that of the last pose before it, or
                the time if there was none.
            sent_ns: when it did.

        Returns:
            When the last message of the part before was sent [ns], and the number of messages by
            topic that were recorded before, and belong to this part.
        """
        last_ns = stamp_ns(part.header)
        # Other guns may stamp by other clocks, and stamps start anew where a bag is replayed.
        known = [p for gun in self._guns for p in (self._forgotten[gun], *self._motion[gun])]
        # Without the last pose, its stamp may be of a clock ahead; what followed is kept.
        unknown_ns = min(last_ns, sent_ns)
        cut_ns = part.last_sent_ns or max(
            (p.sent_ns for p in known if p.stamp_ns == last_ns), default=unknown_ns
        )
        early = {poses: self._forget_motion(poses, cut_ns) for poses in self._guns}
        # A simulator says where a part stands after it has said that the part is there.
        later = [placed for placed in self._placed if placed.sent_ns > sent_ns]
        before = [*self._placed][: len(self._placed) - len(later)][-1:]
        place = list(Rigid.of(part.part_pose).values) if is_pose(part.part_pose) else []
        stays = False
        if before and not later:
            placed = deserialize_message(before[0].cdr, TransformStamped).transform
            t, q = placed.translation, placed.rotation
            stays = [t.x, t.y, t.z, q.x, q.y, q.z, q.w] == place
        self._placed = deque(before if stays else later, REMEMBERED_MESSAGES)
        early[self._part_pose] = len(later)
        return cut_ns, {topic: count for topic, count in early.items() if count}

    def add_late(self, topic: str, cdr: bytes, sent_ns: int) -> None:
        """Note a pose of the part before that comes after this part was announced."""
        self._forgotten[topic] = Recorded(topic, b'', 0, sent_ns, header_stamp_ns(cdr))

    def end_motion(self) -> None:
        """Forget the poses, which no run needs any more, and where the part stood before."""
        self._placed = deque([*self._placed][-1:], REMEMBERED_MESSAGES)
        for poses in self._guns:
            self._forget_motion(poses, math.inf)

    def begin_run(self, log_time_ns: int) -> list[Recorded]:
        """The first messages of a run; what was in force before is logged at this time."""
        self._due = set(self._guns.values())
        lasting = [*self._lasting.values(), *self._transforms, *self._placed]
        early = [pose for poses in self._guns for pose in self._motion[poses]]
        self.begin_ns = min((pose.log_time_ns for pose in early), default=log_time_ns)
        states = [state for pose in early for state in self._states_in_force(pose)]
        return [m._replace(log_time_ns=self.begin_ns) for m in lasting] + states + early

    def _remember_state(self, state: Recorded) -> None:
        """By stamp, and of one stamp in the order in which they were sent, as a film has them; all
        anew where a stream restarted.
        """
        states = self._motion[state.topic]
        # Before any pose the states themselves tell, which are latched from before the recorder.
        newest_ns = states[-1].stamp_ns if states else state.stamp_ns
        if self._reached_ns.get(state.topic, newest_ns) - state.stamp_ns > STREAM_RESTART_NS:
            states.clear()
            if state.topic in self._reached_ns:
                self._reached_ns[state.topic] = state.stamp_ns
        if len(states) == REMEMBERED_MESSAGES:
            states.popleft()
        order = attrgetter('stamp_ns', 'sent_ns')
        states.insert(bisect_right(states, order(state), key=order), state)

    def _replace(self, key: object, message: Recorded) -> None:
        self._lasting.pop(key, None)
        self._lasting[key] = message
        if len(self._lasting) > REMEMBERED_MESSAGES:
            del self._lasting[next(iter(self._lasting))]

    def _states_in_force(self, first: Recorded) -> list[Recorded]:
        """The states of a gun before its first message in a run, unless its stream restarted."""
        topic = self._states_of[first.topic]
        if topic not in self._due or not first.stamp_ns:
            return []
        self._due.remove(topic)
        states = self._motion[topic]
        if states and states[0].stamp_ns - first.stamp_ns > STREAM_RESTART_NS:
            # Latched states may come before those that were sent, and hold, before them.
            for state in [state for state in states if state.sent_ns <= first.sent_ns]:
                states.remove(state)
        # Not at the time of the first message: one received before it may be taken after it.
        return [state._replace(log_time_ns=self.begin_ns) for state in states]

    def _forget_motion(self, poses: str, until_ns: float) -> int:
        """Forget poses sent until then, and superseded states; the number of later poses."""
        remembered = self._motion[poses]
        while remembered and remembered[0].sent_ns <= until_ns:
            self._forgotten[poses] = remembered.popleft()
        states, last = self._motion[self._guns[poses]], self._forgotten[poses]
        # None that were sent after the last pose, for a stream that restarts long before it.
        passed = [
            row for row, state in enumerate(states)
            if state.stamp_ns <= last.stamp_ns and (
                state.sent_ns <= last.sent_ns
                or last.stamp_ns - state.stamp_ns <= STREAM_RESTART_NS
            )
        ]  # fmt: skip
        # Whoever paints may refuse a brush that its model lacks; the state before it then holds.
        newest = {states[row].brush: row for row in passed}
        kept = {row for row in newest.values() if row >= newest.get(CLOSED, 0)}
        for row in reversed(passed):
            if row not in kept:
                del states[row]
        return len(remembered)
