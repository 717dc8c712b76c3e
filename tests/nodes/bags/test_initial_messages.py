"""What a run begins with: the states that are in force at its first pose."""

import pytest
from geometry_msgs.msg import PoseStamped
from paint_msgs.msg import AtomizerState, Part
from rclpy.serialization import deserialize_message, serialize_message

from nodes.cell import START_NS
from paint_deposition.nodes.bags.initial_messages import InitialMessages
from paint_deposition.nodes.runtime.topics import header

POSE, STATE = '/atomizer/pose', '/atomizer/state'
S = 1_000_000_000


@pytest.mark.parametrize(
    ('told', 'in_force'),
    [
        # (what, stamp [s], flow and brush), each sent a second after the one before; the part
        # changes at '|', and the next run begins with the first pose of it.
        ([('state', 0, 1.0, 1), ('pose', 1), '|', ('pose', 2)], [(0, 1.0, 1)]),
        # Announced ahead of the first pose.
        ([('state', 0.3, 1.0, 1), '|', ('pose', 0)], [(0.3, 1.0, 1)]),
        # Of a stream that has ended.
        ([('state', 5, 1.0, 1), ('pose', 5), '|', ('pose', 0)], []),
        # A pose without a time says nothing.
        ([('state', 5, 1.0, 1), ('pose', 5), '|', ('pose', None), ('pose', 6)], [(5, 1.0, 1)]),
        # A model may have brush 1 and no 7: both are needed, and what is before both is not.
        ([('state', 0, 0.5, 1), ('state', 1, 0.6, 1), ('state', 2, 1.0, 7), ('pose', 3), '|',
          ('pose', 4)], [(1, 0.6, 1), (2, 1.0, 7)]),
        ([('state', 0, 0.5, 1), ('state', 1, 0.0, 7), ('state', 2, 1.0, 7), ('pose', 3), '|',
          ('pose', 4)], [(1, 0.0, 7), (2, 1.0, 7)]),
    ],
)  # fmt: skip
def test_a_run_begins_with_the_states_that_hold(told, in_force):
    memory, begun = InitialMessages({POSE: STATE}, '/part_pose'), []
    memory.begin_run(1)
    for sent_s, event in enumerate(told, start=1):
        if event == '|':
            memory.begin_part(Part(last_sent_ns=(sent_s - 1) * S), sent_s * S)
            begun = memory.begin_run(sent_s * S)
            continue
        kind, at_s, *gun = event
        at = header('', 0 if at_s is None else START_NS + round(at_s * S))
        message = PoseStamped(header=at)
        if kind == 'state':
            message = AtomizerState(header=at, spraying=gun[0] > 0.0, flow=gun[0], brush=gun[1])
        topic = POSE if kind == 'pose' else STATE
        begun += memory.add(topic, serialize_message(message), sent_s * S, sent_s * S)
    states = [deserialize_message(first.cdr, AtomizerState) for first in begun]
    stamps_s = [(s.header.stamp.sec * S + s.header.stamp.nanosec - START_NS) / S for s in states]
    assert [(at, s.flow, s.brush) for at, s in zip(stamps_s, states, strict=True)] == in_force


def test_a_latched_state_that_comes_before_older_ones_stays_for_the_next_run():
    """The recorder was started in the midst of a part, and has its newest state first."""
    memory = InitialMessages({POSE: STATE}, '/part_pose')
    memory.begin_run(1)

    def send(topic, stamp_s, sent_s, flow=0.0):
        message = PoseStamped() if topic == POSE else AtomizerState(flow=flow, spraying=flow > 0)
        message.header = header('', START_NS + stamp_s * S)
        return memory.add(topic, serialize_message(message), sent_s * S, sent_s * S)

    send(POSE, 1, 1)
    send(STATE, 9, 9)
    memory.begin_part(Part(), 0)
    memory.begin_run(10 * S)
    send(STATE, 0, 0, 1.0)
    send(POSE, 10, 10)
    memory.begin_part(Part(last_sent_ns=10 * S), 10 * S)
    memory.begin_run(11 * S)
    (first,) = send(POSE, 11, 11)
    assert deserialize_message(first.cdr, AtomizerState).spraying is False


def test_of_two_states_with_one_stamp_the_one_sent_later_holds_whichever_comes_first():
    memory = InitialMessages({POSE: STATE}, '/part_pose')
    memory.begin_run(1)
    for sent_s, flow in ((2, 0.0), (1, 1.0)):
        state = AtomizerState(header=header('', START_NS), spraying=flow > 0.0, flow=flow)
        memory.add(STATE, serialize_message(state), sent_s * S, sent_s * S)
    memory.begin_run(3)
    pose = serialize_message(PoseStamped(header=header('', START_NS + S)))
    first = memory.add(POSE, pose, 3 * S, 3 * S)
    assert [deserialize_message(m.cdr, AtomizerState).flow for m in first] == [1.0, 0.0]
