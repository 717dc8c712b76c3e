"""Node `bag_player`: replays the poses and the trigger of a bag."""

import math
import threading
from functools import partial
from pathlib import Path
from typing import Any

from geometry_msgs.msg import PoseStamped
from paint_msgs.msg import AtomizerState
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.time import Time
from rosgraph_msgs.msg import Clock

from paint_deposition.errors import PaintError
from paint_deposition.files.recordings.bag_files import BagTopic, open_bag
from paint_deposition.files.recordings.bags import motion_of, trajectory_of
from paint_deposition.files.recordings.joint_states import Robot
from paint_deposition.files.recordings.message_definitions import STATE_TYPE
from paint_deposition.files.recordings.pose_topics import POSE_TYPE, choose_pose_topic
from paint_deposition.files.recordings.triggers import BOOL_TYPE, choose_state_topic
from paint_deposition.nodes.bags.pace import FlowControl, ReplayClock
from paint_deposition.nodes.bags.replayed_messages import (
    ReplayedTransforms,
    ReplayMessage,
    pose_messages,
    replay_messages,
)
from paint_deposition.nodes.runtime import topics
from paint_deposition.nodes.runtime.node import OK, WARN, PaintNode, Status
from paint_deposition.nodes.runtime.parameters import NodeParameter, fixed_while_running

PLAYER = fixed_while_running(
    'the replay has begun with it; start another player',
    bag=NodeParameter('', 'Bag to replay: ROS 1 .bag, rosbag2 folder or .mcap file [path]'),
    pose_topic=NodeParameter(
        '',
        "PoseStamped topic in the bag, or with urdf its joint states; empty: the bag's only one "
        '[topic]',
    ),
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
    tip_link=NodeParameter(
        '', 'Link of urdf that is the TCP; empty: tool0, else the last link [name]'
    ),
    base_link=NodeParameter('', 'Link of urdf the poses are in; empty: the root [name]'),
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

    PARAMETERS = PLAYER

    def __init__(self, **kwargs: Any):
        super().__init__('bag_player', **kwargs)
        # Reliable, so that subscribers acknowledge.
        profile = QoSProfile(depth=max(topics.POSE_DEPTH, self.values['window']))
        self._pose_publisher = self.create_publisher(PoseStamped, 'atomizer/pose', profile)
        self._state_publisher = self.create_publisher(AtomizerState, 'atomizer/state', profile)
        self._clock_publisher: Publisher | None = None
        self._clock_order = threading.Lock()
        self._time = ReplayClock(self.values['rate'], running=not self.values['start_paused'])
        if self.values['publish_clock']:
            self._clock_publisher = self.create_publisher(Clock, '/clock', topics.CLOCK)
            self.create_steady_timer(0.01, self._publish_clock)
        self.create_trigger_service('~/pause', partial(self._set_running, False))
        self.create_trigger_service('~/resume', partial(self._set_running, True))
        self._subscribers_to_await = self.values['wait_for_subscribers']
        window = self.values['window']
        self._flow_control = FlowControl(self, self._pose_publisher, window, self.stopped)
        self.poses_published = self.states_published = 0
        self.report({'replay': self.status})
        self.start_thread(self._replay)

    def close(self) -> None:
        super().close()
        replayed = f'replayed {self.poses_published} poses, {self.states_published} states'
        self.get_logger().info(replayed)

    def _load_files(self) -> None:
        values = self.values
        if not values['bag']:
            raise PaintError('bag_player: bag is empty: give the path of a recording')
        with open_bag(values['bag']) as bag:
            self._transforms = ReplayedTransforms(self, bag)
            robot = None
            if values['tf'] and values['urdf']:
                raise PaintError('bag_player: tf and urdf are given: poses come from one of them')
            if values['urdf']:
                robot = Robot.read(
                    Path(values['urdf']), values['tip_link'] or None, values['base_link'] or None
                )
            given = values['pose_topic'] or None, values['tf'] or None, robot
            # The topic of the poses, or the poses of a bag that has none.
            self._pose_topic, self._motion = '', None
            topic = None if robot or values['tf'] else choose_pose_topic(bag, given[0])
            if topic and topic.type == POSE_TYPE:
                self._pose_topic = topic.name
            else:
                self._motion = motion_of(bag, *given)
            self._state_topic: BagTopic | None = None
            unused = [topic.name for topic in bag.topics_of(STATE_TYPE, BOOL_TYPE)]
            if values['state_topic']:
                self._state_topic = choose_state_topic(bag, values['state_topic'])
                if self._state_topic.type == BOOL_TYPE:
                    # Raises an error unless recorder and robot had the same clock.
                    trajectory_of(bag, given[0], values['state_topic'], *given[1:])
            elif unused:
                known = ' '.join(unused)
                self.get_logger().info(
                    f'no state_topic: the gun always sprays; the bag has {known}'
                )

    # --- called by the executor

    def _set_running(self, running: bool) -> tuple[bool, str]:
        changes = self._time.running != running
        self._time.change(running=running)
        if running:
            return changes, 'resumed' if changes else 'not paused'
        return changes, 'paused' if changes else 'already paused'

    def status(self) -> Status:
        if self._clock_publisher and self.count_publishers('/clock') > 1:
            jumps = 'another node publishes /clock, too: time jumps for nodes with use_sim_time'
            return Status(WARN, f'{jumps}; set publish_clock to false for one of them')
        status = self._flow_control.status if self._time.running else 'paused'
        values = {
            'bag': self.values['bag'],
            'poses published': self.poses_published,
            'states published': self.states_published,
            'poses ahead of the slowest subscriber': self._flow_control.poses_ahead,
        }
        return Status(WARN if status.startswith('waiting') else OK, status, values)

    # --- the replay's own thread

    def _replay(self) -> None:
        try:
            while not self.stopped.is_set():
                self._play_once()
                self._flow_control.wait_until_taken()
                if not self.values['loop']:
                    break
        except Exception as error:
            self.fail(error)
            return
        self.finish()

    def _play_once(self) -> None:
        begun = False
        with open_bag(self.values['bag']) as bag:
            computed = pose_messages(*self._motion) if self._motion else ()
            topics = self._pose_topic, self._state_topic, self._transforms.topics
            for message in replay_messages(bag, *topics, computed):
                if not begun:
                    begun = True
                    self._time.change(started=False, time_ns=message.log_time_ns)
                    self._flow_control.wait_for_subscribers(self._subscribers_to_await)
                    self._subscribers_to_await = 0  # when looping
                    self._time.change(started=True)
                self._wait_until_due(message.log_time_ns)
                if self.stopped.is_set():
                    return
                self._time.jump_to(message.log_time_ns)
                self._publish(message)
        self._time.change(started=False)
        self._publish_clock()

    def _wait_until_due(self, log_time_ns: int) -> None:
        """Wait for the end of a pause, the time of a message, and the flow control."""
        while not self.stopped.is_set():
            if self._time.wait_for(log_time_ns, timeout_s=0.05):
                break
        if self.values['rate'] == 0.0:
            self._flow_control.wait_for_room()

    def _publish(self, message: ReplayMessage) -> None:
        if message.transform:
            self._transforms.publish(message.transform)
        elif message.is_pose:
            self._flow_control.add_sent(message.stamp_ns)
            self._pose_publisher.publish(message.cdr)
            self.poses_published += 1
        else:
            self._state_publisher.publish(message.cdr)
            self.states_published += 1

    def _publish_clock(self) -> None:
        with self._clock_order:
            time_ns = self._time.time_ns
            if self._clock_publisher and time_ns is not None:
                self._clock_publisher.publish(Clock(clock=Time(nanoseconds=time_ns).to_msg()))
