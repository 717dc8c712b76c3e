"""Topics of poses: the types that are read, which topic to read, and its poses."""

import re
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from paint_deposition.errors import RecordingError
from paint_deposition.files.recordings.bag_files import Bag, BagTopic, listed_topics
from paint_deposition.files.recordings.headers import pose_of, stamp_ns
from paint_deposition.files.recordings.message_definitions import JOINT_TYPE, TF_TYPES
from paint_deposition.files.recordings.transforms import PART_POSE_TYPE, part_pose_topics
from paint_deposition.motion.trajectory import Trajectory

POSE_TYPE = 'geometry_msgs/msg/PoseStamped'
ARRAY_TYPE = 'geometry_msgs/msg/PoseArray'
# The pose in a message of each type.
POSES: dict[str, Callable[[Any], Any]] = {
    POSE_TYPE: lambda message: message.pose,
    'geometry_msgs/msg/PoseWithCovarianceStamped': lambda message: message.pose.pose,
    'nav_msgs/msg/Odometry': lambda message: message.pose.pose,
    PART_POSE_TYPE: lambda message: message.transform,
    ARRAY_TYPE: lambda message: message.poses,
}
ELEMENT = re.compile(r'(?P<topic>.*)\[(?P<number>\d+)\]')


def pose_topics(bag: Bag) -> list[BagTopic]:
    """The topics of poses in a bag; those of PoseStamped first, none of the part's pose."""
    others = part_pose_topics(bag)
    return [topic for topic in bag.topics_of(*POSES) if topic.name not in others]


def choose_pose_topic(bag: Bag, name: str | None) -> BagTopic:
    """The named topic of poses of a bag, or its only one; errors list the candidates.

    The only one is that of PoseStamped, or where there is none that of another type.
    """
    kind = 'pose' if {topic.type for topic in pose_topics(bag)} - {POSE_TYPE} else 'PoseStamped'
    if not name:
        candidates = bag.topics_of(POSE_TYPE) or pose_topics(bag)
        if len(candidates) != 1:
            listed = listed_topics(candidates, kind)
            raise RecordingError(f'{bag.path}: name a pose topic; {listed}{_other_motion(bag)}')
        name = candidates[0].name
    topic = bag.choose(_element(name)[0], tuple(POSES), kind)
    if topic.message_count == 0:
        raise RecordingError(f'{topic.name} in {bag.path} has no messages; record it again')
    return topic


def _element(name: str) -> tuple[str, int | None]:
    """The topic and the number of '/poses[2]'."""
    element = ELEMENT.fullmatch(name)
    return (element['topic'], int(element['number'])) if element else (name, None)


def _other_motion(bag: Bag) -> str:
    """Other sources of motion in a bag, for a message."""
    moves = []
    if bag.topics_of(*TF_TYPES):
        moves.append('transforms (give tf: TARGET SOURCE)')
    if bag.topics_of(JOINT_TYPE):
        moves.append('joint states (give urdf)')
    return f'; it has {" and ".join(moves)}' if moves else ''


def read_poses(bag: Bag, name: str | None) -> tuple[Trajectory, np.ndarray, str]:
    """The poses of a topic as recorded, when they were logged (N,) int64 [ns], and its name.

    Poses in several frames are said to be in the most frequent one, and ``frames`` has that of
    each. Raises RecordingError for several bodies, or if all poses have one stamp.
    """
    topic = choose_pose_topic(bag, name)
    number = _element(name or '')[1]
    stamps, log_times, rows = [], [], []
    frames: list[str] = []
    bodies: Counter[str] = Counter()
    for _, log_time_ns, message in bag.decoded([topic.name]):
        pose = POSES[topic.type](message)
        if topic.type == ARRAY_TYPE:
            pose = _one_of(pose, number, topic.name)
        stamps.append(stamp_ns(message.header))
        log_times.append(log_time_ns)
        rows.append(np.concatenate(pose_of(pose)))
        frames.append(message.header.frame_id.lstrip('/'))
        bodies[message.child_frame_id if topic.type == PART_POSE_TYPE else ''] += 1
    if len(rows) != topic.message_count:
        raise RecordingError(
            f'{bag.path} lists {topic.message_count} messages on {topic.name} and holds '
            f'{len(rows)}; run: paint recover {bag.path}'
        )
    if len(bodies) > 1:
        found = ', '.join(f"'{body}' ({count})" for body, count in sorted(bodies.items()))
        raise RecordingError(f'{topic.name} in {bag.path} mixes frames {found}; record one frame')
    if len(stamps) > 1 and len(set(stamps)) == 1:
        raise RecordingError(
            f'all {len(stamps)} poses on {topic.name} in {bag.path} are stamped {stamps[0]} ns; '
            'let the publisher stamp each pose'
        )
    values = np.array(rows, dtype=float)
    positions, quaternions = map(np.ascontiguousarray, np.split(values, [3], axis=1))
    ((frame_id, most),) = Counter(frames).most_common(1)
    trajectory = Trajectory(
        np.array(stamps, np.int64), positions, quaternions, frame_id,
        frames=tuple(frames) if most < len(frames) else (),
    )  # fmt: skip
    return trajectory, np.array(log_times, np.int64), topic.name


def _one_of(poses: Sequence[Any], number: int | None, topic: str) -> Any:
    """The pose of this number in an array, or its only one."""
    if number is None and len(poses) != 1:
        raise RecordingError(
            f'{topic} has {len(poses)} poses in a message; name the one of the gun, as {topic}[0]'
        )
    if (number or 0) >= len(poses):
        raise RecordingError(f'{topic} has {len(poses)} poses in a message, and none [{number}]')
    return poses[number or 0]
