"""The messages with which a run begins: what is in force, and what came for its part already."""

import math
from collections import deque
from collections.abc import Mapping
from typing import Any, NamedTuple

from paint_msgs.msg import AtomizerState, Part
from rcl_interfaces.msg import ParameterEvent
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Header

from paint_deposition.errors import RecordingError
from paint_deposition.files.recordings.messages import (
    TF_TYPES,
    own_types,
    stamp_ns,
    trigger_change,
)
from paint_deposition.motion.pose_stream import TriggerChange
from paint_deposition.motion.transforms import Rigid
from paint_deposition.nodes.bags.recorded_topic import PARAMETER_EVENTS, STATIC_TF
from paint_deposition.nodes.topics import header_stamp_ns, part_pose_message
from paint_deposition.request import is_pose

# Of each topic of a gun, for the time in which a simulator reads the mesh of the next part.
REMEMBERED_MESSAGES = 20_000
TF = '/tf'


class Recorded(NamedTuple):
    """A serialised message, when it was logged and sent; its stamp if it is of a gun."""

    topic: str
    cdr: bytes
    log_time_ns: int
    sent_ns: int
    stamp_ns: int = 0


class InitialMessages:
    """Remembers what later runs need: poses and states, part pose, transforms, parameters.

    Args:
        guns: topics of the poses and of the states of each gun, by its name.
        part_pose: topic of the part's pose.

    Attributes:
        begin_ns: log time of the first message of the run.
    """

    def __init__(self, guns: Mapping[str, tuple[str, str]], part_pose: str) -> None:
        self._states_of = {name: states for name, (_, states) in guns.items()}
        # Topic of the states by that of the poses.
        self._guns, self._part_pose = dict(guns.values()), part_pose
        self._motion: dict[str, deque[Recorded]] = {
            topic: deque(maxlen=REMEMBERED_MESSAGES) for gun in guns.values() for topic in gun
        }
        # The last pose of each gun that was forgotten.
        self._forgotten = {poses: Recorded(poses, b'', 0, 0) for poses in self._guns}
        self.begin_ns = 0
        self._placed: deque[Recorded] = deque(maxlen=REMEMBERED_MESSAGES)
        self._transforms: deque[Recorded] = deque(maxlen=REMEMBERED_MESSAGES)
        self._lasting: dict[object, Recorded] = {}

    def add(self, topic: str, cdr: bytes, log_time_ns: int, sent_ns: int) -> None:
        """Remember a message if a later run may need it."""
        message = Recorded(topic, cdr, log_time_ns, sent_ns)
        if topic in self._motion:
            self._motion[topic].append(message._replace(stamp_ns=header_stamp_ns(cdr)))
        elif topic == self._part_pose:
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
            placed: Any = own_types().deserialize_cdr(cdr, TF_TYPES[0])
            children = frozenset(each.child_frame_id for each in placed.transforms)
            self._replace((STATIC_TF, children), message)

    def begin_part(self, part: Part, sent_ns: int) -> tuple[dict[str, int], dict[str, int]]:
        """Forget what only the parts before needed.

        Args:
            part: as a simulator announced it; header.stamp is that of the last pose before it, or
                the time if there was none.
            sent_ns: when it did.

        Returns:
            By topic when the last message of the part before was sent [ns], and the number of
            messages that were recorded before, and belong to this part.
        """
        last_ns = stamp_ns(part.header)
        # Other guns may stamp by other clocks, and stamps start anew where a bag is replayed.
        known = [p for gun in self._guns for p in (self._forgotten[gun], *self._motion[gun])]
        # Without the last pose, its stamp may be of a clock ahead; what followed is kept.
        unknown_ns = min(last_ns, sent_ns)
        cut_ns = part.last_sent_ns or max(
            (p.sent_ns for p in known if p.stamp_ns == last_ns), default=unknown_ns
        )
        until_ns = dict.fromkeys(self._guns, cut_ns)
        early = {poses: self._forget_poses(poses, cut_ns) for poses in self._guns}
        for name, last_sent_ns in zip(part.guns, part.states_sent_ns, strict=False):
            topic = self._states_of.get(name)
            if topic is not None:
                until_ns[topic] = last_sent_ns
                carried = [state for state in part.states if state.header.frame_id == name]
                early[topic] = self._take_over(topic, carried, last_sent_ns)
        # What the simulator says next of where the part stands may come when its run is over.
        later = [placed for placed in self._placed if placed.sent_ns > sent_ns]
        early[self._part_pose] = len(later)
        if is_pose(part.part_pose):
            place = Rigid.of(part.part_pose).values
            frames = part.part_parent_frame, part.header.frame_id
            cdr = serialize_message(part_pose_message(*frames, last_ns, place))
            later.insert(0, Recorded(self._part_pose, cdr, 0, sent_ns))
        self._placed = deque(later, REMEMBERED_MESSAGES)
        return until_ns, {topic: count for topic, count in early.items() if count}

    def add_late(self, topic: str, cdr: bytes, sent_ns: int) -> None:
        """Note a pose of the part before that comes after this part was announced."""
        self._forgotten[topic] = Recorded(topic, b'', 0, sent_ns, header_stamp_ns(cdr))

    def end_motion(self) -> None:
        """Forget the poses, which no run needs any more, states that others have superseded, and
        where the part stood before.
        """
        self._placed = deque([*self._placed][-1:], REMEMBERED_MESSAGES)
        for poses, topic in self._guns.items():
            self._forget_poses(poses, math.inf)
            states = sorted(self._motion[topic], key=lambda state: state.stamp_ns)
            states = [s for s in states if _told(deserialize_message(s.cdr, AtomizerState))]
            passed = sum(s.stamp_ns <= self._forgotten[poses].stamp_ns for s in states)
            self._motion[topic] = deque(states[max(passed - 1, 0) :], REMEMBERED_MESSAGES)

    def begin_run(self, log_time_ns: int) -> list[Recorded]:
        """The first messages of a run; what was in force before is logged as early as any."""
        in_force = [*self._lasting.values(), *self._transforms, *self._placed]
        early = [pose for poses in self._guns for pose in self._motion[poses]]
        states = [state for topic in self._guns.values() for state in self._motion[topic]]
        states.sort(key=lambda state: state.sent_ns)
        self.begin_ns = min((pose.log_time_ns for pose in early), default=log_time_ns)
        first = [message._replace(log_time_ns=self.begin_ns) for message in in_force]
        first += [s._replace(log_time_ns=max(s.log_time_ns, self.begin_ns)) for s in states]
        return first + early

    def _replace(self, key: object, message: Recorded) -> None:
        self._lasting.pop(key, None)
        self._lasting[key] = message
        if len(self._lasting) > REMEMBERED_MESSAGES:
            del self._lasting[next(iter(self._lasting))]

    def _forget_poses(self, poses: str, until_ns: float) -> int:
        """Forget poses sent until then; the number of later ones."""
        remembered = self._motion[poses]
        while remembered and remembered[0].sent_ns <= until_ns:
            self._forgotten[poses] = remembered.popleft()
        return len(remembered)

    def _take_over(self, topic: str, carried: list[AtomizerState], until_ns: int) -> int:
        """Have what a gun carries over instead of the states sent until then; the number of later
        ones.
        """
        remembered = self._motion[topic]
        later = [state for state in remembered if state.sent_ns > until_ns]
        before = [state for state in reversed(remembered) if state.sent_ns <= until_ns]
        taken = []
        for state in carried:
            # The part says what moves a film; the rest, the voltage say, stays as it was sent.
            messages = (deserialize_message(sent.cdr, AtomizerState) for sent in before)
            told = next((sent for sent in messages if _told(sent) == _told(state)), state)
            told.header = Header(stamp=state.header.stamp)
            taken.append(Recorded(topic, serialize_message(told), 0, until_ns))
        self._motion[topic] = deque([*taken, *later], REMEMBERED_MESSAGES)
        return len(later)


def _told(state: AtomizerState) -> TriggerChange | None:
    """What a state says of the gun; None of one that whoever paints refuses."""
    try:
        return trigger_change(state)
    except RecordingError:
        return None
