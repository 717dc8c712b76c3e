"""Node `egm_source`: poses and joints that an ABB robot streams by EGM."""

import socket
import threading
import time
from typing import Any

from geometry_msgs.msg import PoseStamped
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

from paint_deposition.errors import PaintError
from paint_deposition.nodes.robot.egm_stream import EgmSample, EgmStream, egm_message
from paint_deposition.nodes.runtime.messages import header
from paint_deposition.nodes.runtime.node import ERROR, OK, WARN, Diagnostics, PaintNode, Status
from paint_deposition.nodes.runtime.parameters import NodeParameter, fixed_while_running
from paint_deposition.nodes.runtime.topics import POSE_DEPTH

SILENT_S = 2.0
POLL_S = 0.2
# Another sender is reported for so long [ns].
OTHER_NS = 10_000_000_000

SOURCE = fixed_while_running(
    'the stream is read with it; restart the node',
    address=NodeParameter('0.0.0.0', 'Address of this machine that the robot sends to [IP]'),
    robot_address=NodeParameter(
        '', 'Address of the robot; empty: of the first that sends positions [IP]'
    ),
    port=NodeParameter(6510, "UDP port of the robot's UDPUC device [-]", (1, 65535)),
    frame_id=NodeParameter(
        'base_link', 'Name of the correction frame that EGMActPose or EGMStreamStart has [name]'
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
        constraints='above 0, one for each external axis',
        allows=lambda value: all(scale > 0.0 for scale in value or ()),
        element=float,
    ),
    lag_s=NodeParameter(
        0.015, 'Age of a position when it is sent, taken from its stamp; 0.010 to 0.025 [s]',
        (0.0, 1.0),
    ),
)  # fmt: skip


class EgmSource(PaintNode):
    """Publishes `atomizer/pose` and `joint_states` from the UDP packets of a robot.

    It listens and never answers, so that it cannot steer the robot: EGM position stream
    (EGMStreamStart), or beside another sensor. The stamp is the time at which the position was
    measured, by the controller's clock and ``lag_s``.
    """

    PARAMETERS = SOURCE

    def __init__(self, **kwargs: Any):
        super().__init__('egm_source', **kwargs)
        profile = QoSProfile(depth=POSE_DEPTH)
        self._poses = self.create_publisher(PoseStamped, 'atomizer/pose', profile)
        self._joints = self.create_publisher(JointState, 'joint_states', profile)
        self.stream = EgmStream(round(1e9 * self.values['lag_s']))
        self._heard_s = time.monotonic()
        Diagnostics(self, {'robot': self._status})
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._listen, name='egm', daemon=True)
        self._thread.start()

    def _validate(self, values: Any) -> None:
        egm_message()
        if len(values['external_joints']) != len(values['external_scales']):
            raise PaintError(
                f'{len(values["external_joints"])} external_joints go with '
                f'{len(values["external_scales"])} external_scales; give one scale a joint'
            )

    def _load_files(self) -> None:
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
        self._socket.settimeout(POLL_S)

    def close(self) -> None:
        self._stop()
        heard = self.stream
        self.get_logger().info(
            f'{heard.received} packets, {heard.lost} lost, {heard.repeated} repeated'
        )

    def destroy_node(self) -> None:
        self._stop()
        super().destroy_node()

    def _stop(self) -> None:
        self._stopped.set()
        self._thread.join()
        self._socket.close()

    def _listen(self) -> None:
        while not self._stopped.is_set():
            try:
                packet, (sender, _) = self._socket.recvfrom(65_536)
            except TimeoutError:
                continue
            arrived_ns = time.time_ns()
            if self.values['robot_address'] not in ('', sender):
                self.stream.invalid += 1
            elif sample := self.stream.take(packet, arrived_ns, sender):
                self._heard_s = time.monotonic()
                self._publish(sample)

    def _publish(self, sample: EgmSample) -> None:
        at = header(self.values['frame_id'], sample.stamp_ns)
        if sample.pose is not None:
            pose = PoseStamped(header=at)
            p, q = pose.pose.position, pose.pose.orientation
            p.x, p.y, p.z, q.x, q.y, q.z, q.w = sample.pose
            self._poses.publish(pose)
        names, external = self.values['joint_names'], self.values['external_joints']
        if len(sample.joints_rad) >= len(names) and len(sample.external) >= len(external):
            scaled = sample.external[: len(external)] * self.values['external_scales']
            positions = [*sample.joints_rad[: len(names)].tolist(), *scaled.tolist()]
            state = JointState(header=at, name=[*names, *external], position=positions)
            self._joints.publish(state)

    def _status(self) -> Status:
        stream, values = self.stream, self.values
        own = 'not sent' if stream.own_lag_ns is None else f'{1e-6 * stream.own_lag_ns:.1f}'
        figures = {
            'robot': stream.sender or 'none yet', 'packets': stream.received,
            'packets lost': stream.lost, 'packets repeated': stream.repeated,
            'packets that are no EgmRobot': stream.invalid,
            'lag taken out [ms]': f'{1e3 * values["lag_s"]:.1f}',
            'last packet later than the fastest [ms]': f'{1e-6 * stream.late_ns:.1f}',
            "from the controller's own time to arrival [ms]": own,
        }  # fmt: skip
        if time.time_ns() - stream.other_ns < OTHER_NS:
            remedy = 'give each robot a port and a node of its own, or robot_address'
            return Status(ERROR, f'{stream.other} sends, too: {remedy}', figures)
        if time.monotonic() - self._heard_s > SILENT_S:
            return Status(
                WARN, f'no packets on UDP port {values["port"]}: start EGMStreamStart with the '
                'address of this machine in UDPUC', figures,
            )  # fmt: skip
        if stream.lost or stream.repeated or stream.invalid:
            words = f'{stream.lost} packets lost, {stream.repeated} repeated'
            return Status(WARN, f'{words}, {stream.invalid} no EgmRobot', figures)
        return Status(OK, 'following the robot', figures)
