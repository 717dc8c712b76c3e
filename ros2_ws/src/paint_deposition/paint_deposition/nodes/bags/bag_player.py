"""Node `bag_player`: replays the poses and the trigger of a bag."""

import math
import threading
import time
from collections.abc import Iterable, Iterator, Mapping
from heapq import merge
from itertools import groupby
from operator import attrgetter
from pathlib import Path

import numpy as np
from geometry_msgs.msg import PoseStamped, TransformStamped
from paint_msgs.msg import AtomizerState
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from paint_deposition.errors import PaintError
from paint_deposition.files.recordings.bag_files import Bag, BagTopic, RawMessage, open_bag
from paint_deposition.files.recordings.bags import (
    BOOL_TYPE,
    STATE_TYPES,
    motion_of,
    trajectory_of,
)
from paint_deposition.files.recordings.joint_states import Robot
from paint_deposition.files.recordings.messages import TF_TYPES, stamp_ns
from paint_deposition.files.recordings.pose_topics import (
    PART_POSE_TYPE,
    POSE_TYPE,
    STATIC,
    choose_pose_topic,
    part_pose_topics,
    read_frames,
)
from paint_deposition.motion.trajectory import relative_flow
from paint_deposition.nodes import topics
from paint_deposition.nodes.bags.pace import Pace
from paint_deposition.nodes.node import OK, WARN, PaintNode, Status, Task
from paint_deposition.nodes.parameters import NodeParameter, fixed, requested
from paint_deposition.nodes.topics import header, header_stamp_ns, pose_message, state_message
from paint_deposition.request import MotionOptions


class BagPlayer(PaintNode):
    """Publishes `atomizer/pose`, `atomizer/state` and transforms as recorded, and /clock.

    At any rate, poses are published in the recorded order as the recorded bytes, or as computed
    from transforms or joint states of the bag. A std_msgs/Bool
    trigger becomes an AtomizerState stamped with its log time. At rate 0 the player stays at most
    `window` poses ahead of the slowest node that reports PoseProgress on `atomizer/progress`; a
    node that does not report may lose what overflows its queue. In a loop the stamps jump back to
    the start of the bag each time. /clock advances between the messages as well, and repeats the
    same time while the replay is paused.
    """

    NAME = 'bag_player'
    PARAMETERS = fixed(
        'the replay has begun with it; start another player',
        bag=NodeParameter('', 'Bag to replay: ROS 1 .bag, rosbag2 folder or .mcap file [path]'),
        pose_topic=requested(MotionOptions, 'pose_topic', ''),
        tf=NodeParameter(
            [],
            'Frame of the poses and frame of the TCP, where transforms of the bag give the poses; '
            'empty: they do not [names]',
            constraints='two names, or none',
            allows=lambda value: not value or len(value) == 2,
            element=str,
        ),
        urdf=NodeParameter(
            '', 'The robot whose joint states in the bag give the poses; empty: they do not [path]'
        ),
        tip_link=requested(MotionOptions, 'tip_link', ''),
        base_link=requested(MotionOptions, 'base_link', ''),
        state_topic=NodeParameter(
            '', 'Trigger in the bag, AtomizerState or std_msgs/Bool; empty: none [topic]'
        ),
        rate=NodeParameter(
            1.0,
            'Speed relative to the recording; 0: as fast as the subscribers take poses [-]',
            (0.0, math.inf),
        ),
        loop=NodeParameter(False, 'Start again at the end [true/false]'),
        start_paused=NodeParameter(False, 'Wait for ~/resume before the start [true/false]'),
        wait_for_subscribers=NodeParameter(
            1, 'Subscribers of atomizer/pose to wait for before the start [count]', (0, math.inf)
        ),
        window=NodeParameter(
            200, 'Poses ahead of the slowest subscriber at rate 0 [count]', (1, 10_000)
        ),
        publish_clock=NodeParameter(True, 'Publish /clock [true/false]'),
    )

    def _configure(self) -> Mapping[str, Task]:
        values = self.values
        if not values['bag']:
            raise PaintError('bag_player: bag is empty: give the path of a recording')
        if values['tf'] and values['urdf']:
            raise PaintError('bag_player: tf and urdf are given: poses come from one of them')
        robot = None
        if values['urdf']:
            robot = Robot.read(
                Path(values['urdf']), values['tip_link'] or None, values['base_link'] or None
            )
        motion = values['pose_topic'] or None, values['tf'] or None, robot
        with open_bag(values['bag']) as bag:
            self._create_transform_publishers(bag)
            # The topic of the poses, or the computed poses of a bag that has none.
            self._pose_topic, self._motion = '', None
            topic = None if robot or values['tf'] else choose_pose_topic(bag, motion[0])
            if topic and topic.type == POSE_TYPE:
                self._pose_topic = topic.name
            else:
                self._motion = motion_of(bag, *motion)
            self._state_topic: BagTopic | None = None
            unused = [topic.name for topic in bag.topics_of(*STATE_TYPES)]
            if values['state_topic']:
                self._state_topic = bag.choose(values['state_topic'], STATE_TYPES, 'state')
                if self._state_topic.type == BOOL_TYPE:
                    # Raises an error unless recorder and robot had the same clock.
                    trajectory_of(bag, motion[0], values['state_topic'], *motion[1:])
            elif unused:
                self.get_logger().info(
                    f'no state_topic: the gun always sprays; the bag has {" ".join(unused)}'
                )
        # Reliable, so that subscribers acknowledge.
        profile = QoSProfile(depth=max(topics.POSE_DEPTH, values['window']))
        self._pose_publisher = self.create_publisher(PoseStamped, topics.POSE_TOPIC, profile)
        self._state_publisher = self.create_publisher(AtomizerState, topics.STATE_TOPIC, profile)
        self._clock_publisher: Publisher | None = None
        self._clock_order = threading.Lock()
        self._pace = Pace(
            self, self._pose_publisher, self.stop_requested, rate=values['rate'],
            window=values['window'], running=not values['start_paused'],
        )  # fmt: skip
        if values['publish_clock']:
            self._clock_publisher = self.create_publisher(Clock, '/clock', topics.CLOCK)
            self.create_steady_timer(0.01, self._publish_clock)
        self.create_service(Trigger, '~/pause', lambda *_: self._set_running(False))
        self.create_service(Trigger, '~/resume', lambda *_: self._set_running(True))
        self._subscribers_to_await = values['wait_for_subscribers']
        self.poses_published = self.states_published = 0
        self.start_thread(self._replay)
        return {'replay': self.status}

    def close(self) -> None:
        super().close()
        replayed = f'replayed {self.poses_published} poses, {self.states_published} states'
        self.get_logger().info(replayed)

    def _create_transform_publishers(self, bag: Bag) -> None:
        """Without tf2_msgs none, and a warning that names the parameters to set instead."""
        self._transform_publishers: dict[bool, Publisher] = {}
        self._transform_topics: list[str] = []
        named = [topic.name for topic in bag.topics_of(*TF_TYPES)] + part_pose_topics(bag)
        if not named:
            return
        try:
            from tf2_msgs.msg import TFMessage
        except ImportError:
            place = 'part_parent_frame and part_pose'
            if placed := read_frames(bag).placed('part'):
                values = ', '.join(f'{value:.9g}' for value in placed[1].values)
                place = f"part_parent_frame: '{placed[0]}' and part_pose: [{values}]"
            self.get_logger().warning(
                f'{bag.path} has transforms, and tf2_msgs is not installed: they are not '
                f'replayed; set {place} of the simulator'
            )
            return
        self._transform_topics = named
        for static in (False, True):
            durability = DurabilityPolicy.TRANSIENT_LOCAL if static else DurabilityPolicy.VOLATILE
            self._transform_publishers[static] = self.create_publisher(
                TFMessage, f'/{STATIC}' if static else '/tf',
                QoSProfile(depth=100, durability=durability),
            )  # fmt: skip

    # --- called by the executor

    def _set_running(self, running: bool) -> Trigger.Response:
        changes = self._pace.running != running
        self._pace.change(running=running)
        if changes:
            message = 'resumed' if running else 'paused'
        else:
            message = 'not paused' if running else 'already paused'
        return Trigger.Response(success=True, message=message)

    def status(self) -> Status:
        if self._clock_publisher and self.count_publishers('/clock') > 1:
            jumps = 'another node publishes /clock, too: time jumps for nodes with use_sim_time'
            return WARN, f'{jumps}; set publish_clock to false for one of them', {}
        status = self._pace.status if self._pace.running else 'paused'
        ahead = self._pace.write_off_lost(time.monotonic())
        values = {
            'bag': self.values['bag'],
            'poses published': self.poses_published,
            'states published': self.states_published,
            'poses ahead of the slowest subscriber': max(ahead.values(), default=0),
        }
        return WARN if status.startswith('waiting') else OK, status, values

    # --- the replay's own thread

    def _replay(self) -> None:
        while not self.stop_requested.is_set():
            begun = False
            with open_bag(self.values['bag']) as bag:
                for message in self._messages(bag):
                    if not begun:
                        begun = True
                        self._pace.change(started=False, time_ns=message.log_time_ns)
                        self._pace.wait_for_subscribers(self._subscribers_to_await)
                        self._subscribers_to_await = 0  # when looping
                        self._pace.change(started=True)
                    self._pace.wait_for(message.log_time_ns)
                    if self.stop_requested.is_set():
                        break
                    self._publish(message, bag)
            self._pace.change(started=False)
            self._publish_clock()
            self._pace.wait_until_taken()
            if not self.values['loop']:
                break
        self.finish()

    def _messages(self, bag: Bag) -> Iterator[RawMessage]:
        """Poses, states and transforms by log time; at equal times, poses last."""
        named = [self._pose_topic, self._state_topic.name if self._state_topic else '']
        read = [*filter(None, named), *self._transform_topics]
        poses: Iterable[RawMessage] = ()
        if self._motion:
            motion, log_times_ns = self._motion
            frame_id, stamps_ns = motion.frame_id, motion.stamps_ns.tolist()
            # Log times never go back.
            logged_ns = np.maximum.accumulate(log_times_ns).tolist()
            places = np.hstack([motion.positions_m, motion.quaternions_xyzw]).tolist()
            poses = (
                RawMessage('', '', at_ns, serialize_message(pose_message(frame_id, stamp, place)))
                for stamp, at_ns, place in zip(stamps_ns, logged_ns, places, strict=True)
            )
        log_time = attrgetter('log_time_ns')
        messages = merge(bag.messages(read), poses, key=log_time)
        for _, simultaneous in groupby(messages, key=log_time):
            yield from sorted(simultaneous, key=lambda each: each.topic == self._pose_topic)

    def _publish(self, message: RawMessage, bag: Bag) -> None:
        if message.topic == self._pose_topic:
            self._pace.add_sent(header_stamp_ns(message.cdr), time.monotonic())
            self._pose_publisher.publish(message.cdr)
            self.poses_published += 1
        elif message.type == PART_POSE_TYPE:  # it becomes a static transform
            publisher = self._transform_publishers[True]
            placed = deserialize_message(message.cdr, TransformStamped)
            publisher.publish(serialize_message(publisher.msg_type(transforms=[placed])))
        elif message.topic in self._transform_topics:
            self._transform_publishers[message.topic.endswith(STATIC)].publish(message.cdr)
        else:
            if message.type == BOOL_TYPE:
                spraying = deserialize_message(message.cdr, Bool).data
                at, flow = header('', message.log_time_ns), relative_flow(spraying)
                state = state_message(header=at, spraying=spraying, flow=flow)
            else:  # of any version: fields of the same name are copied
                recorded = bag.decode(message)
                at = header(recorded.header.frame_id, stamp_ns(recorded.header))
                state = state_message(header=at)
                for name in state.get_fields_and_field_types():
                    if name != 'header' and hasattr(recorded, name):
                        kind = type(getattr(state, name))
                        setattr(state, name, kind(getattr(recorded, name)))
            self._state_publisher.publish(state)
            self.states_published += 1

    def _publish_clock(self) -> None:
        with self._clock_order:
            time_ns = self._pace.time_ns
            if self._clock_publisher and time_ns is not None:
                self._clock_publisher.publish(Clock(clock=Time(nanoseconds=time_ns).to_msg()))
