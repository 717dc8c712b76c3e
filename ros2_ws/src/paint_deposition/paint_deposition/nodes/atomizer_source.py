"""Node `atomizer_source`: poses and states of the gun from the topics of a robot driver."""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from paint_msgs.msg import AtomizerState
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import JointState

from paint_deposition.errors import PaintError, RecordingError
from paint_deposition.files.recordings.bags import MAX_CLOCK_OFFSET_S
from paint_deposition.files.recordings.joint_states import DEFAULT_TIP, Robot
from paint_deposition.files.recordings.messages import Signal, stamp_ns
from paint_deposition.model.eq1_pattern import MOST
from paint_deposition.motion.trajectory import ONLY_BRUSH
from paint_deposition.motion.transforms import Rigid
from paint_deposition.nodes.frames import QUEUE_DEPTH, SILENT_S, TfPoses
from paint_deposition.nodes.node import ERROR, OK, WARN, PaintNode, Status, Task
from paint_deposition.nodes.parameters import NodeParameter, fixed, requested
from paint_deposition.nodes.topics import (
    POSE_DEPTH,
    POSE_TOPIC,
    STATE_TOPIC,
    AdaptiveSubscription,
    header,
    message_class,
    pose_message,
    state_message,
)
from paint_deposition.request import POSE_FORMAT, MotionOptions, is_pose

# Late subscribers need the current state, slow ones every change.
LATCHED_STATES = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
SIGNALS = ('trigger', 'flow', 'brush', 'speed')
# What a signal must be, where not every number will do.
USABLE: dict[str, tuple[Callable[[float], bool], str]] = {
    'trigger': (math.isfinite, 'a number or Bool'),
    'brush': (lambda value: value.is_integer() and 0 <= value <= MOST, f'0 to {MOST}'),
}
SIGNAL = 'a topic, or a field of its messages, as /io.states[3] or /io.level > 12'


class AtomizerSource(PaintNode):
    """Publishes `atomizer/pose` from a robot's joints or tf, and `atomizer/state` from signals.

    With a trigger alone it publishes the states of a robot that publishes its poses itself. A pose
    has the stamp of its joint state or transform. A signal takes effect at the stamp of its
    message, or at the time it was sent if there is none.
    """

    NAME = 'atomizer_source'
    PARAMETERS = fixed(
        'the subscriptions are made with it when the node starts; restart the node',
        urdf_file=NodeParameter(
            '',
            'The robot, URDF, whose joint states give the poses; empty: tf gives them, or without '
            'base_link the robot publishes them itself [path]',
        ),
        tip_link=NodeParameter(
            '', 'Link or frame that carries the bell; empty: tool0, else the last link [name]'
        ),
        base_link=NodeParameter(
            '', 'Link or frame of the poses; empty: the root of urdf_file [name]'
        ),
        joint_topic=NodeParameter('joint_states', "The robot's sensor_msgs/JointState [topic]"),
        joint_prefix=requested(MotionOptions, 'joint_prefix', ''),
        angle_unit=NodeParameter(
            '',
            'Unit of joints that turn; empty: rad, and one beyond its limits is refused [name]',
            choices=('', 'rad', 'deg'),
        ),
        tcp_offset=NodeParameter(
            [],
            'Pose of the TCP, z toward the part, in tip_link, x y z qx qy qz qw; empty: tip_link '
            'is the TCP [m, -]',
            constraints=f'{POSE_FORMAT}, or none',
            allows=lambda value: not value or is_pose(value),
            element=float,
        ),
        trigger=NodeParameter(
            '',
            f'Signal that opens the gun: {SIGNAL}; empty: no atomizer/state is published [topic]',
        ),
        flow=NodeParameter(
            '', f'Signal of the flow: {SIGNAL}; empty: the calibrated flow [topic]'
        ),
        brush=NodeParameter(
            '', f'Signal of the number of the brush: {SIGNAL}; empty: the only one [topic]'
        ),
        speed=NodeParameter(
            '', f'Signal of the programmed speed of the TCP: {SIGNAL}; empty: nothing [topic]'
        ),
        speed_scale=NodeParameter(
            1.0, 'm/s for one unit of that signal; 0.001 for mm/s [m/s]', (1e-9, 1e9)
        ),
        calibrated_flow=NodeParameter(
            1.0, 'Value of that signal at the calibrated flow [its unit]', (1e-9, 1e9)
        ),
    )

    def _validate(self, values: Mapping[str, Any], changed: set[str]) -> None:
        if not any(values[name] for name in ('urdf_file', 'base_link', 'trigger')):
            raise PaintError(
                f'{self.get_name()}: urdf_file and base_link are empty: give the robot, or the '
                'frame in which tf knows its tip; or trigger alone beside a robot that publishes '
                f'{POSE_TOPIC}'
            )
        alone = [name for name in SIGNALS[1:] if values[name] and not values['trigger']]
        if alone:
            raise PaintError(f'{alone[0]} is given without a trigger: name the signal of the gun')
        for name in SIGNALS:
            if values[name] and Signal.parse(values[name]) is None:
                raise PaintError(f"{name} is '{values[name]}': give {SIGNAL}")

    def _configure(self) -> Mapping[str, Task]:
        values = self.values
        self._tcp = Rigid.of(values['tcp_offset'] or [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        named = {name: Signal.parse(values[name]) for name in SIGNALS}
        self._signals = {name: signal for name, signal in named.items() if signal is not None}
        self._state_publisher = self.create_publisher(AtomizerState, STATE_TOPIC, LATCHED_STATES)
        # Topics that have no publisher yet, with their callbacks; joints may be signals, too.
        self._missing: set[tuple[str, Callable[..., None]]] = {
            (signal.topic, self._on_signal_message) for signal in self._signals.values()
        }
        self._values: dict[str, float] = {}
        self._published, self._newest_ns = '', 0
        self.poses_published = 0
        # Of the robot's poses: their frame, when the last came, and how late they are sent.
        self._base, self._pose_s, self._clock_offset_s = '', time.monotonic(), 0.0
        # How many joint states give none, and why the last does not, '' if it does.
        self._incomplete, self._refusal = 0, ''
        self._problems: dict[str, str] = {}  # by topic
        self._heard: list[AdaptiveSubscription] = []
        self._tf: TfPoses | None = None
        if values['urdf_file']:
            robot = Robot.read(
                Path(values['urdf_file']), values['tip_link'] or None, values['base_link'] or None
            )
            prefix, unit = values['joint_prefix'], values['angle_unit'] or None
            robot = replace(robot, joint_prefix=prefix, angle_unit=unit)
            self._base, self._tip = robot.base, robot.tip
            self._missing.add((values['joint_topic'], partial(self._take_joints, robot)))
        elif values['base_link']:
            tip = values['tip_link'] or DEFAULT_TIP
            self._tf = TfPoses(self, values['base_link'], tip, self._publish_pose)
            self._base, self._tip = self._tf.base, self._tf.tip
            self._heard += self._tf.topics
        if self._base:
            depth = QoSProfile(depth=POSE_DEPTH)
            self._pose_publisher = self.create_publisher(PoseStamped, POSE_TOPIC, depth)
        else:  # a robot publishes them itself
            self.create_subscription(
                PoseStamped, POSE_TOPIC, self._watch_pose, qos_profile_sensor_data
            )
        self.create_steady_timer(0.1, self._discover_topics)
        return {'robot': self._robot_status, 'signals': self._signals_status}

    # --- poses

    def _take_joints(
        self, robot: Robot, topic: str, message: JointState, info: Mapping[str, Any]
    ) -> None:
        """Publish the pose for a joint state, which needs all joints."""
        positions_by_name = dict(zip(message.name, message.position, strict=False))
        try:
            found = robot.recorded_joints(positions_by_name, topic)
            values = np.array([[found[name] for name in robot.arm.joints]])
            if not np.isfinite(values).all():
                raise RecordingError(f'{topic} has joints that are not finite')
            positions, quaternions = robot.poses(robot.in_si(values, topic))
        except RecordingError as error:
            self._incomplete, self._refusal = self._incomplete + 1, str(error)
            return
        self._pose_s, self._refusal = time.monotonic(), ''
        tip = Rigid.of([*positions[0], *quaternions[0]])
        self._publish_pose(stamp_ns(message.header), tip, info['source_timestamp'])

    def _publish_pose(self, stamp: int, tip: Rigid, sent_ns: int) -> None:
        if sent_ns:
            self._clock_offset_s = (sent_ns - stamp) * 1e-9
        pose = pose_message(self._base, stamp, (tip @ self._tcp).values)
        self._pose_publisher.publish(pose)
        self.poses_published += 1

    def _watch_pose(self, pose: PoseStamped, info: Mapping[str, Any]) -> None:
        self._base, self._pose_s = pose.header.frame_id, time.monotonic()
        if info['source_timestamp']:
            self._clock_offset_s = (info['source_timestamp'] - stamp_ns(pose.header)) * 1e-9

    # --- signals

    def _discover_topics(self) -> None:
        """Subscribe to topics as soon as their type and quality of service are known."""
        for topic, take in tuple(self._missing):
            found = self.get_publishers_info_by_topic(self.resolve_topic_name(topic))
            if found:
                kind = found[0].topic_type
                try:
                    message = message_class(kind)
                except (ImportError, AttributeError):
                    reason = f'{topic} comes as {kind}, which is not installed: source it'
                    self._problems[topic] = reason
                    continue
                self._heard.append(
                    AdaptiveSubscription(
                        self, message, topic, partial(take, topic), depth=QUEUE_DEPTH,
                        latched=True, polled=False,
                    )
                )  # fmt: skip
                self._missing.discard((topic, take))
        for subscription in self._heard:
            subscription.match_qos()

    def _on_signal_message(self, topic: str, message: Any, info: Mapping[str, Any]) -> None:
        """Take trigger, flow, brush and speed, which may be fields of one message, and publish
        the state if it has changed.
        """
        stamp = stamp_ns(message.header) if hasattr(message, 'header') else 0
        problem = ''
        for name, signal in self._signals.items():
            if signal.topic != topic:
                continue
            value = signal.value(message)
            if value is None:
                kind, path = type(message).__name__, signal.path or '.data'
                problem = f'{topic}: {kind} has no number or Bool at {path}'
            elif name in USABLE and not USABLE[name][0](value):
                problem = f'{topic}: {name} is {value:g}: give {USABLE[name][1]}'
            elif not stamp and abs(self._clock_offset_s) > MAX_CLOCK_OFFSET_S:
                problem = (
                    f'{topic} has no stamps, and the poses of the robot are sent '
                    f'{self._clock_offset_s:.3g} s off their own stamps: set the clocks'
                )
            else:
                self._values[name] = value
        self._problems[topic] = problem
        at_ns = stamp or info['source_timestamp'] or self.get_clock().now().nanoseconds
        # Signals overtake each other, and a state is as new as the newest; unless a clock was set
        # back.
        if at_ns >= self._newest_ns - 1e9 * MAX_CLOCK_OFFSET_S:
            at_ns = max(at_ns, self._newest_ns)
        self._newest_ns = at_ns
        # All signals must be known.
        if problem or self._signals.keys() - self._values.keys():
            return
        full = self.values['calibrated_flow']
        speed = self._values.get('speed', math.nan) * self.values['speed_scale']
        state = state_message(
            spraying=bool(self._signals['trigger'].is_on(self._values['trigger'])),
            flow=self._values.get('flow', full) / full,
            brush=int(self._values.get('brush', ONLY_BRUSH)),
            programmed_speed_m_per_s=speed,
        )
        if str(state) != self._published:  # NaN does not equal itself
            self._published = str(state)
            state.header = header(self._base, at_ns)
            self._state_publisher.publish(state)

    # --- diagnostics

    def _robot_status(self) -> Status:
        is_silent = time.monotonic() - self._pose_s > SILENT_S
        if self._tf is None and not self.values['urdf_file']:
            if is_silent:
                remedy = 'if none are to come, give urdf_file or base_link'
                return WARN, f'no poses on {POSE_TOPIC}; {remedy}', {}
            return OK, 'the robot publishes its poses', {}
        values: dict[str, object] = {
            'poses': f"of '{self._tip}' in '{self._base}'", 'published': self.poses_published,
        }  # fmt: skip
        if self._tf is not None:
            level, words, figures = self._tf.status()
            return level, words, {**values, **figures}
        file = Path(self.values['urdf_file'])
        values |= {'robot': file, 'joint states refused': self._incomplete}
        if self._incomplete and not self.poses_published:
            return ERROR, f'no joint state has all joints: {self._refusal}', values
        if is_silent and self._refusal:
            return ERROR, f'joint states are refused: {self._refusal}', values
        if is_silent:
            return WARN, f'no joint states on {self.values["joint_topic"]}', values
        return OK, 'following the robot', values

    def _signals_status(self) -> Status:
        values = {
            f'{name}, {signal.topic}{signal.path}': self._values.get(name, 'not received')
            for name, signal in self._signals.items()
        }
        if problems := [problem for problem in self._problems.values() if problem]:
            return ERROR, '; '.join(problems), values
        missing = [name for name, value in values.items() if value == 'not received']
        if missing:
            return WARN, f'not received: {" ".join(missing)}', values
        return OK, 'following the signals' if values else 'no signal is named', values
