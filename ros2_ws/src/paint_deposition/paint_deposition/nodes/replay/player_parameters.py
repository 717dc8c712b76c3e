"""Parameters of `bag_player`."""

from __future__ import annotations

from paint_deposition.nodes.runtime.parameters import NodeParameter, fixed

PLAYER = fixed(
    'the replay has begun with it; start another player',
    NodeParameter(
        'bag',
        '',
        'Bag to replay: ROS 1 .bag, rosbag2 folder or .mcap file [path]',
        is_path=True,
    ),
    NodeParameter(
        'pose_topic', '', "PoseStamped topic in the bag; empty: the bag's only one [topic]"
    ),
    NodeParameter(
        'state_topic',
        '',
        'Trigger in the bag, AtomizerState or std_msgs/Bool; empty: none [topic]',
    ),
    NodeParameter(
        'rate',
        1.0,
        'Speed relative to the recording; 0: as fast as the subscribers take poses [-]',
        low=0.0,
    ),
    NodeParameter('loop', False, 'Start again at the end [true/false]'),
    NodeParameter('start_paused', False, 'Wait for ~/resume before the start [true/false]'),
    NodeParameter(
        'wait_for_subscribers',
        1,
        'Subscribers of atomizer/pose to wait for before the start [count]',
        low=0,
    ),
    NodeParameter(
        'window',
        200,
        'Poses ahead of the slowest subscriber at rate 0 [count]',
        low=1,
        high=10_000,
    ),
    NodeParameter('publish_clock', True, 'Publish /clock [true/false]'),
)
