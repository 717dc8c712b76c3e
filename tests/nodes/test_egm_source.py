"""An EGM stream over real UDP, in the wire format that ABB documents, encoded here by hand."""

import socket
import struct
import time

import numpy as np
import pytest

from nodes.cell import free_port
from paint_deposition.errors import PaintError
from paint_deposition.files.recordings.messages import stamp_ns
from paint_deposition.nodes.egm_source import EgmSource, EgmStream

MM = (812.5, -240.25, 955.0)
WXYZ = (0.5, 0.5, -0.5, 0.5)
DEGREES = (10.0, -20.0, 30.0, 170.0, 45.0, -400.0)
LAG_NS = 15_000_000


def varint(value: int) -> bytes:
    low, rest = value & 0x7F, value >> 7
    return bytes([low | 0x80]) + varint(rest) if rest else bytes([low])


def field(number: int, content: float | int | bytes) -> bytes:
    """A field of a protobuf message: double, integer, or a message of its own."""
    if isinstance(content, bytes):
        return varint(number << 3 | 2) + varint(len(content)) + content
    if isinstance(content, float):
        return varint(number << 3 | 1) + struct.pack('<d', content)
    return varint(number << 3) + varint(content)


def numbered(values) -> bytes:
    return b''.join(field(k, value) for k, value in enumerate(values, start=1))


def doubles(values) -> bytes:
    return b''.join(field(1, value) for value in values)


def egm_robot(number: int, tm_ms: int, placed: bool = True) -> bytes:
    """EgmRobot with all that a controller sends, more than is read of it; or without a place."""
    place = numbered([numbered(MM), numbered(WXYZ), numbered((180.0, 0.0, 90.0))])
    place = place if placed else field(2, numbered(WXYZ))
    clock = numbered((1_760_000_000, 250_000))
    position = numbered([doubles(DEGREES), place, doubles((1500.0, 0.0)), clock])
    state = field(1, 3)
    head = numbered([number, tm_ms, 2])
    more = state, 1, doubles((0.0,) * 6), state
    return numbered([head, position, position, state, *more]) + field(10, 12.5)


def test_positions_have_the_controllers_clock_and_late_packets_do_not_delay_them():
    stream = EgmStream(LAG_NS)
    late_ms = np.array([3, 1, 1, 9, 1, 22, 2, 1])
    sent_ms = 5_000 + 4 * np.arange(len(late_ms))
    begin_ns = 1_760_000_000_000_000_000
    arrived = begin_ns + (sent_ms + late_ms) * 1_000_000
    packets = [egm_robot(k + 7, int(ms)) for k, ms in enumerate(sent_ms)]
    samples = [stream.take(*each) for each in zip(packets, arrived.tolist(), strict=True)]
    stamps = np.array([sample[0] for sample in samples])
    # All but the first, which was the fastest so far.
    assert np.array_equal(stamps[1:], begin_ns + (sent_ms[1:] + 1) * 1_000_000 - LAG_NS)
    _, pose, joints_rad, external = samples[-1]
    assert pose == pytest.approx((0.8125, -0.24025, 0.955, 0.5, -0.5, 0.5, 0.5))
    assert np.degrees(joints_rad) == pytest.approx(DEGREES)
    assert external.tolist() == [1500.0, 0.0]


def test_packets_are_counted_by_their_numbers_and_a_restart_is_none_of_them():
    stream = EgmStream(0)
    numbers = [40, 41, 41, 45, 44, 46, 0, 1]
    taken = [stream.take(egm_robot(n, 4 * n), 10**18 + 4_000_000 * n) for n in numbers]
    assert [sample is not None for sample in taken] == [1, 1, 0, 1, 0, 1, 1, 1]
    assert (stream.received, stream.lost, stream.repeated) == (8, 3, 2)


def test_only_whole_packets_take_the_port_and_a_silent_robot_leaves_it():
    stream, now_ns = EgmStream(0), 10**18
    rng = np.random.default_rng(5)
    odd = [b'', b'\x08', b'\xff\xff\xff', numbered([numbered([7, 8])]), egm_robot(3, 4)[:12]]
    odd += [rng.bytes(60) for _ in range(40)]
    for packet in odd:
        assert stream.take(packet, now_ns, 'stranger') is None
    assert (stream.sender, stream.invalid, stream.lost) == ('', len(odd), 0)
    assert stream.take(egm_robot(1, 4), now_ns, 'robot') is not None
    assert stream.take(egm_robot(9000, 4), now_ns + 10**9, 'another') is None
    assert (stream.sender, stream.other, stream.lost) == ('robot', 'another', 0)
    assert stream.take(egm_robot(9001, 8), now_ns + 2 * 10**9, 'another') is not None
    assert (stream.sender, stream.lost) == ('another', 0)


@pytest.mark.parametrize('step_ms', [-(2**32), -60_000, 60_000])
def test_a_step_of_the_controllers_clock_does_not_move_the_stamps(step_ms):
    """It runs over after 49.7 days, and is set."""
    stream, now_ns = EgmStream(LAG_NS), 10**18
    begin_ms = 2**32 - 100 if step_ms == -(2**32) else 100_000
    for k in range(60):
        tm_ms = begin_ms + 4 * k + (step_ms if k >= 25 else 0)
        stamp, *_ = stream.take(egm_robot(k + 7, tm_ms), now_ns + 4_000_000 * k)
        assert stamp == now_ns + 4_000_000 * k - LAG_NS


def test_the_node_publishes_what_the_robot_streams_and_sends_nothing(start, onlooker, wait_until):
    port, viewer = free_port(), onlooker('atomizer/pose', 'joint_states')
    rail = {'external_joints': ['rail'], 'external_scales': [0.001]}
    chosen = {'address': '127.0.0.1', 'port': port, 'frame_id': 'wobj'} | rail
    start(EgmSource, **chosen)
    with pytest.raises(PaintError, match=r'cannot listen on .*or give another port'):
        start(EgmSource, **chosen)
    wait_until(lambda: viewer.count_publishers('atomizer/pose'), what='discovery')
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as robot:
        robot.bind(('127.0.0.1', 0))
        robot.settimeout(0.05)
        for number in range(1, 41):
            for _ in range(1 + (number == 30)):
                if number not in (10, 11):
                    robot.sendto(egm_robot(number, 4 * number), ('127.0.0.1', port))
        wait_until(lambda: len(viewer.heard['atomizer/pose']) == 38, what='the poses')
        with pytest.raises(TimeoutError):
            robot.recvfrom(100)
    pose = viewer.newest('atomizer/pose')
    assert pose.header.frame_id == 'wobj'
    assert pose.pose.position.x == pytest.approx(0.8125)
    assert 0 < time.time_ns() - stamp_ns(pose.header) < 60e9
    wait_until(lambda: viewer.heard['joint_states'])
    joints = viewer.newest('joint_states')
    assert joints.name[-2:] == ['joint_6', 'rail']
    assert joints.position[-2:].tolist() == pytest.approx([np.radians(-400.0), 1.5])
    wait_until(lambda: viewer.reports('egm_source: robot', '2 packets lost, 1 repeated'))


@pytest.mark.parametrize(('axes', 'placed', 'told'), [
    (3, True, 'packets have 2 external axes'),
    (0, False, 'packets have no pose: give EGM a tool'),
])  # fmt: skip
def test_what_packets_lack_is_told(start, onlooker, wait_until, monkeypatch, axes, placed, told):
    names = [f'axis_{k}' for k in range(axes)]
    given = {'external_joints': names, 'external_scales': [1.0] * axes}
    node, viewer = start(EgmSource, address='127.0.0.1', port=16511, **given), onlooker()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as robot:
        numbers = iter(range(1, 10_000))

        def says() -> bool:
            robot.sendto(egm_robot(next(numbers), 1000, placed=placed), ('127.0.0.1', 16511))
            return viewer.reports('egm_source: robot', told, b'\x02')

        wait_until(says, what=told)

        def broken(*_: object) -> None:
            raise OSError('the network is gone')

        # Whatever else the thread fails with ends the process.
        monkeypatch.setattr(EgmStream, 'take', broken)
        says()
        wait_until(node.finished.done, what='the end')
    assert isinstance(node.finished.exception(), OSError)
