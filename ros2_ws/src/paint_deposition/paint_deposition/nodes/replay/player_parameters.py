"""Parameters of `bag_player`."""

from __future__ import annotations

from paint_deposition.nodes.runtime.parameters import NodeParameter

ONE_BAG = 'the replay of this bag has begun; start another player'
ONE_PACE = 'the whole replay keeps one pace; start another player'
AT_START = 'it says how the replay begins; start another player'

PLAYER = (
    NodeParameter(
        'bag',
        '',
        'Bag to replay: ROS 1 .bag, rosbag2 folder or .mcap file [path]',
        is_path=True,
        fixed_because=ONE_BAG,
    ),
    NodeParameter(
        'pose_topic',
        '',
        "PoseStamped topic in the bag; empty: the bag's only one [topic]",
        fixed_because=ONE_BAG,
    ),
    NodeParameter(
        'state_topic',
        '',
        'Trigger in the bag, AtomizerState or std_msgs/Bool; empty: none [topic]',
        fixed_because=ONE_BAG,
    ),
    NodeParameter(
        'rate',
        1.0,
        'Speed relative to the recording; 0: as fast as the subscribers take [-]',
        low=0.0,
        fixed_because=ONE_PACE,
    ),
    NodeParameter(
        'loop',
        False,
        'Start again at the end [true/false]',
        fixed_because='whoever listens was promised one round or many; start another player',
    ),
    NodeParameter(
        'start_paused',
        False,
        'Wait for ~/resume before the start [true/false]',
        fixed_because='it says how the replay begins; call ~/pause or ~/resume',
    ),
    NodeParameter(
        'wait_for_subscribers',
        1,
        'Subscribers of atomizer/pose to wait for before the start [count]',
        low=0,
        fixed_because=AT_START,
    ),
    NodeParameter(
        'window',
        200,
        'Poses ahead of the slowest subscriber at rate 0 [count]',
        low=1,
        high=10_000,
        fixed_because='the publisher keeps so many poses; start another player',
    ),
    NodeParameter(
        'publish_clock',
        True,
        'Publish /clock [true/false]',
        fixed_because='nodes that follow /clock would be left without time; start another player',
    ),
)
