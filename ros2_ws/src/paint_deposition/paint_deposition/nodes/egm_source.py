"""Node `egm_source`: poses and joints that an ABB robot streams by EGM (UDP, protobuf)."""

import socket
import time
from collections import deque
from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

from paint_deposition.errors import PaintError
from paint_deposition.nodes.node import ERROR, OK, WARN, PaintNode, Status, Task
from paint_deposition.nodes.parameters import NodeParameter, fixed
from paint_deposition.nodes.topics import POSE_DEPTH, POSE_TOPIC, header, pose_message

# What is read of EGM's messages: field, number and type of the wire format that ABB documents in
# 3HAC073319 (EGM, sensor protocol); others are passed over.
MESSAGES = {
    'Header': {'seqno': (1, 'uint32'), 'tm': (2, 'uint32')},
    'Cartesian': {axis: (k, 'double') for k, axis in enumerate('xyz', start=1)},
    'Quaternion': {f'u{k}': (k + 1, 'double') for k in range(4)},
    'Pose': {'pos': (1, 'Cartesian'), 'orient': (2, 'Quaternion')},
    'Joints': {'joints': (1, 'doubles')},
    'FeedBack': {
        'joints': (1, 'Joints'), 'cartesian': (2, 'Pose'), 'externalJoints': (3, 'Joints'),
    },
    'Robot': {'header': (1, 'Header'), 'feedBack': (2, 'FeedBack')},
}  # fmt: skip


@cache
def egm_message() -> Any:
    """The class of the message ``Robot`` in ``MESSAGES``: all of EgmRobot that is read.

    Raises PaintError where protobuf is not installed.
    """
    try:
        from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
    except ImportError:
        raise PaintError(
            'egm_source needs protobuf, which is not installed; run: pip install protobuf'
        ) from None
    file = descriptor_pb2.FileDescriptorProto(name='egm_read.proto', package='egm_read')
    kinds = descriptor_pb2.FieldDescriptorProto
    for message, fields in MESSAGES.items():
        described = file.message_type.add(name=message)
        for field, (number, kind) in fields.items():
            many = kinds.LABEL_REPEATED if kind == 'doubles' else kinds.LABEL_OPTIONAL
            made = described.field.add(name=field, number=number, label=many)
            if kind in MESSAGES:
                made.type, made.type_name = kinds.TYPE_MESSAGE, f'.egm_read.{kind}'
            else:
                made.type = getattr(kinds, f'TYPE_{kind.rstrip("s").upper()}')
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName('egm_read.Robot'))


# Stamp [ns]; TCP in the correction frame x y z [m] qx qy qz qw, None if none was sent; the robot's
# joints [rad]; external axes as sent [deg, mm].
Position = tuple[int, tuple[float, ...] | None, np.ndarray, np.ndarray]


class EgmStream:
    """Decodes the packets of one robot, counts those lost and repeated, and stamps positions.

    The controller's milliseconds are brought to this machine's clock by the packets that were
    fastest of late, so that a late packet does not delay its position; ``lag_ns`` is the age of a
    position when its packet leaves.

    The first to send a whole EgmRobot is the robot, until it is silent.

    Attributes:
        received, lost, repeated, invalid: packets; lost ones by the gaps of their numbers.
        sender: address of the robot, '' before the first packet; other: of another that sends,
            too, the last of them at ``other_ns``.
        late_ns: how much later than the fastest way the last packet came.
    """

    def __init__(self, lag_ns: int) -> None:
        self.lag_ns = lag_ns
        self.received = self.lost = self.repeated = self.invalid = self.late_ns = 0
        self.sender = self.other = ''
        self.other_ns = self._heard_ns = self._sent_ns = 0
        self._newest: int | None = None
        # The clock of the controller drifts: only so many packets say what the fastest way takes.
        self._ways_ns: deque[int] = deque(maxlen=2500)

    def take(self, packet: bytes, arrived_ns: int, sender: str = '') -> Position | None:
        """The position in a packet; None for one that is not the robot's, invalid, repeated or
        out of order.
        """
        from google.protobuf.message import DecodeError

        try:
            robot = egm_message().FromString(packet)
        except DecodeError:
            robot = None
        measured = None if robot is None else _measured(robot)
        if measured is None:
            self.invalid += 1
            return None
        if sender != self.sender:
            # Silent for so long, it leaves the port to another.
            if self.sender and arrived_ns - self._heard_ns < 2_000_000_000:
                self.other, self.other_ns = sender, arrived_ns
                return None
            self.sender, self._newest = sender, None
            self._ways_ns.clear()
        self._heard_ns = arrived_ns
        self.received += 1
        if not self._is_next(robot.header.seqno):
            self.repeated += 1
            return None
        sent_ns = robot.header.tm * 1_000_000
        if sent_ns < self._sent_ns:  # the clock was set back, or its 32 bits have run over
            self._ways_ns.clear()
        self._sent_ns = sent_ns
        self._ways_ns.append(arrived_ns - sent_ns)
        fastest_ns = min(self._ways_ns)
        self.late_ns = arrived_ns - sent_ns - fastest_ns
        return sent_ns + fastest_ns - self.lag_ns, *measured

    def _is_next(self, number: int) -> bool:
        """Whether a packet is newer than those before; counts what is missing between."""
        step = 1 if self._newest is None else number - self._newest
        # A stream that was started again.
        if step < -1000 or (step < 0 and number <= 1):
            self._ways_ns.clear()
            step = 1
        if step <= 0:
            return False
        self.lost += step - 1
        self._newest = number
        return True


def _measured(robot: Any) -> tuple[tuple[float, ...] | None, np.ndarray, np.ndarray] | None:
    """Pose, joints and external axes of a packet, as in a ``Position``; None if it is not whole.

    It needs number and time, and a pose or joints, all of them finite. A pose of which a number
    is missing is none.
    """
    if not (robot.header.HasField('seqno') and robot.header.HasField('tm')):
        return None
    place, pose = robot.feedBack.cartesian, None
    of_pose = [(place.pos, axis) for axis in 'xyz']
    of_pose += [(place.orient, f'u{k}') for k in (1, 2, 3, 0)]
    if all(kind.HasField(name) for kind, name in of_pose):
        values = [getattr(kind, name) for kind, name in of_pose]
        pose = (*(1e-3 * value for value in values[:3]), *values[3:])
    joints = np.radians(robot.feedBack.joints.joints)
    external = np.array(robot.feedBack.externalJoints.joints)
    is_finite = bool(np.isfinite([*joints, *external, *(pose or ())]).all())
    return (pose, joints, external) if is_finite and (pose or len(joints)) else None


class EgmSource(PaintNode):
    """Publishes `atomizer/pose` and `joint_states` from the UDP packets of a robot.

    It listens and never answers, so that it cannot steer the robot: EGM position stream
    (EGMStreamStart), or beside another sensor. The stamp is the time at which the position was
    measured, by the controller's clock and ``lag_s``.
    """

    NAME = 'egm_source'
    PARAMETERS = fixed(
        'the stream is read with it; restart the node',
        address=NodeParameter('0.0.0.0', 'Address of this machine that the robot sends to [IP]'),
        robot_address=NodeParameter(
            '', 'Address of the robot; empty: of the first that sends positions [IP]'
        ),
        port=NodeParameter(6510, "UDP port of the robot's UDPUC device [-]", (1, 65535)),
        frame_id=NodeParameter(
            'base_link',
            'Name of the correction frame that EGMActPose or EGMStreamStart has [name]',
        ),
        joint_names=NodeParameter(
            [f'joint_{k}' for k in range(1, 7)], "Names of the robot's joints [names]", element=str
        ),
        external_joints=NodeParameter(
            [], "Names of the external axes, in the controller's order; empty: left out [names]",
            element=str,
        ),
        external_scales=NodeParameter(
            [], 'rad or m for one unit of each external axis, 0.001 for a rail in mm [rad, m]',
            constraints='numbers above 0, one for each external axis',
            allows=lambda value: all(scale > 0.0 for scale in value or ()),
            element=float,
        ),
        lag_s=NodeParameter(
            0.015, 'Age of a position when it is sent, taken from its stamp; 0.010 to 0.025 [s]',
            (0.0, 1.0),
        ),
    )  # fmt: skip

    def _validate(self, values: Any, changed: set[str]) -> None:
        egm_message()
        if len(values['external_joints']) != len(values['external_scales']):
            raise PaintError(
                f'{len(values["external_joints"])} external_joints go with '
                f'{len(values["external_scales"])} external_scales; give one scale a joint'
            )

    def _configure(self) -> Mapping[str, Task]:
        address = self.values['address'], self.values['port']
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind(address)
        except OSError as error:
            self._socket.close()
            raise PaintError(
                f'cannot listen on {address[0]}, UDP port {address[1]}: {error.strerror}; end '
                'what else listens there, or give another port'
            ) from None
        self._socket.settimeout(0.2)
        profile = QoSProfile(depth=POSE_DEPTH)
        self._poses = self.create_publisher(PoseStamped, POSE_TOPIC, profile)
        self._joints = self.create_publisher(JointState, 'joint_states', profile)
        self.stream = EgmStream(round(1e9 * self.values['lag_s']))
        self._heard_s, self._lacks = time.monotonic(), ''
        self.start_thread(self._listen)
        return {'robot': self.status}

    def close(self) -> None:
        super().close()
        heard = self.stream
        self.get_logger().info(
            f'{heard.received} packets, {heard.lost} lost, {heard.repeated} repeated'
        )

    def _listen(self) -> None:
        frame_id, names = self.values['frame_id'], self.values['joint_names']
        external = self.values['external_joints']
        with self._socket:
            while not self.stop_requested.is_set():
                try:
                    packet, (sender, _) = self._socket.recvfrom(65_536)
                except TimeoutError:
                    continue
                arrived_ns = time.time_ns()
                if self.values['robot_address'] not in ('', sender):
                    self.stream.invalid += 1
                elif position := self.stream.take(packet, arrived_ns, sender):
                    self._heard_s = time.monotonic()
                    stamp, pose, joints, axes = position
                    self._lacks = ''
                    if len(axes) < len(external):
                        self._lacks = f'{len(axes)} external axes, and external_joints has more'
                    if pose is None:
                        self._lacks = 'no pose: give EGM a tool and a frame'
                    else:
                        self._poses.publish(pose_message(frame_id, stamp, pose))
                    if len(joints) >= len(names) and len(axes) >= len(external):
                        scaled = axes[: len(external)] * self.values['external_scales']
                        positions = [*joints[: len(names)].tolist(), *scaled.tolist()]
                        at = header(frame_id, stamp)
                        message = JointState(
                            header=at, name=[*names, *external], position=positions
                        )
                        self._joints.publish(message)

    def status(self) -> Status:
        stream, values = self.stream, self.values
        figures = {
            'robot': stream.sender or 'none yet', 'packets': stream.received,
            'packets lost': stream.lost, 'packets repeated': stream.repeated,
            'packets that are no EgmRobot': stream.invalid,
            'last packet later than the fastest [ms]': f'{1e-6 * stream.late_ns:.1f}',
        }  # fmt: skip
        if time.time_ns() - stream.other_ns < 10_000_000_000:
            remedy = 'give each robot a port and a node of its own, or robot_address'
            return ERROR, f'{stream.other} sends, too: {remedy}', figures
        if time.monotonic() - self._heard_s > 2.0:
            remedy = 'start EGMStreamStart with the address of this machine in UDPUC'
            return WARN, f'no packets on UDP port {values["port"]}: {remedy}', figures
        if self._lacks:
            return ERROR, f'packets have {self._lacks}', figures
        if stream.lost or stream.repeated or stream.invalid:
            words = f'{stream.lost} packets lost, {stream.repeated} repeated'
            return WARN, f'{words}, {stream.invalid} no EgmRobot', figures
        return OK, 'following the robot', figures
