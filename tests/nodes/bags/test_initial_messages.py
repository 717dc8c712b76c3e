"""What a run begins with: the states that are in force at its first pose."""

from math import inf

from geometry_msgs.msg import PoseStamped, TransformStamped
from paint_msgs.msg import AtomizerState, Part
from rclpy.serialization import deserialize_message, serialize_message

from files.recorded import TF, Messages
from nodes.cell import START_NS
from paint_deposition.files.recordings.messages import stamp_ns
from paint_deposition.motion.transforms import Rigid
from paint_deposition.nodes.bags.initial_messages import InitialMessages
from paint_deposition.nodes.topics import header, state_message

POSE, STATE = '/atomizer/pose', '/atomizer/state'
S = 1_000_000_000


def sent(topic, stamp_s, sent_s, **gun):
    message = AtomizerState(spraying=gun.get('flow', 0.0) > 0.0, **gun)
    message = PoseStamped() if topic == POSE else message
    message.header = header('', START_NS + stamp_s * S)
    return topic, serialize_message(message), sent_s * S, sent_s * S


def remembered(*messages) -> InitialMessages:
    memory = InitialMessages({'': (POSE, STATE)}, '/part_pose')
    for message in messages:
        memory.add(*message)
    return memory


def states_of(begun) -> list[AtomizerState]:
    return [deserialize_message(m.cdr, AtomizerState) for m in begun if m.topic == STATE]


def test_a_run_begins_with_what_its_part_carries_over_and_what_was_sent_since():
    """Whatever else the recorder has heard; it adds what moves no film."""
    memory = remembered(
        sent(STATE, 0, 1, flow=0.5, brush=2, voltage_kv=60.0), sent(POSE, 1, 2),
        sent(STATE, 2, 3, flow=1.0, brush=9), sent(POSE, 2, 4), sent(STATE, 3, 5, flow=0.0),
        sent(POSE, 3, 6),
    )  # fmt: skip
    carried = [
        state_message(
            header=header('', START_NS + at_s * S), spraying=True, flow=flow, brush=brush
        )
        for at_s, flow, brush in ((0, 0.5, 2), (4, 1.0, 1))
    ]
    part = Part(last_sent_ns=4 * S, guns=[''], states_sent_ns=[4 * S], states=carried)
    until_ns, early = memory.begin_part(part, 7 * S)
    assert until_ns == {POSE: 4 * S, STATE: 4 * S}
    assert early == {POSE: 1, STATE: 1}
    begun = memory.begin_run(7 * S)
    assert [message.topic for message in begun] == [STATE, STATE, STATE, POSE]
    assert [message.log_time_ns for message in begun] == [6 * S] * 4
    states = states_of(begun)
    told = [(stamp_ns(s.header), s.spraying, s.flow, s.brush) for s in states]
    assert told == [
        (START_NS, True, 0.5, 2), (START_NS + 4 * S, True, 1.0, 1),
        (START_NS + 3 * S, False, 0.0, 0),
    ]  # fmt: skip
    assert states[0].voltage_kv == 60.0


def test_a_run_begins_with_where_its_part_stands_whether_or_not_that_was_heard():
    """What the simulator says of it after the part may get lost, and come when the run is over."""
    place, placed = [0.1, 0.0, 0.05, 0.0, 0.0, 0.6, 0.8], []
    memory = remembered(('/part_pose', b'of the part before', S, S))
    for heard in [], [('/part_pose', b'of this part', 4 * S, 4 * S)]:
        for message in heard:
            memory.add(*message)
        part = Part(part_pose=place, part_parent_frame='cell', header=header('part', START_NS))
        memory.begin_part(part, 3 * S)
        first, *others = memory.begin_run(5 * S)
        assert [message.cdr for message in others] == [message[1] for message in heard]
        placed.append(deserialize_message(first.cdr, TransformStamped))
    for told in placed:
        t, q = told.transform.translation, told.transform.rotation
        assert (told.header.frame_id, told.child_frame_id) == ('cell', 'part')
        assert [t.x, t.y, t.z, q.x, q.y, q.z, q.w] == list(Rigid.of(place).values)


def test_without_a_part_a_run_begins_with_the_states_in_force_at_the_last_pose_before_it():
    memory = remembered(
        sent(STATE, 0, 1, flow=1.0), sent(STATE, 1, 2, flow=0.5), sent(STATE, 2, 3, flow=inf),
        sent(POSE, 3, 4), sent(STATE, 4, 5, flow=0.0),
    )  # fmt: skip
    memory.end_motion()
    begun = memory.begin_run(6 * S)
    assert {message.topic for message in begun} == {STATE}
    assert [state.flow for state in states_of(begun)] == [0.5, 0.0]


def test_of_two_states_with_one_stamp_the_one_sent_later_holds_whichever_comes_first():
    begun = remembered(sent(STATE, 0, 2, flow=0.0), sent(STATE, 0, 1, flow=1.0)).begin_run(3)
    assert [state.flow for state in states_of(begun)] == [1.0, 0.0]


def test_a_static_transform_that_is_sent_again_takes_the_place_of_the_former():
    memory, messages = remembered(), Messages()
    for sent_s, (child, x) in enumerate([('a', 1.0), ('b', 2.0), ('a', 3.0)]):
        cdr = messages.serialised(messages.transforms((0, 'world', child, [x, 0, 0, 0, 0, 0, 1])))
        memory.add('/tf_static', bytes(cdr), sent_s * S, sent_s * S)
    begun = [messages.store.deserialize_cdr(m.cdr, TF).transforms for m in memory.begin_run(9 * S)]
    assert [placed.transform.translation.x for (placed,) in begun] == [2.0, 3.0]
