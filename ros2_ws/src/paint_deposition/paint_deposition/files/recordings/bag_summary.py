"""A summary of a bag: its topics, and whether each source of poses in it will do."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from paint_deposition.errors import RecordingError
from paint_deposition.files.recordings.bag_files import Bag, BagTopic, open_bag
from paint_deposition.files.recordings.headers import stamp_ns
from paint_deposition.files.recordings.message_definitions import JOINT_TYPE, STATE_TYPE
from paint_deposition.files.recordings.pose_topics import (
    moving_transforms,
    pose_topics,
    read_poses,
)
from paint_deposition.files.recordings.triggers import BOOL_TYPE
from paint_deposition.motion.stream_quality import StreamQuality, looks_like_mm


@dataclass(frozen=True)
class PoseSource:
    """One source of poses in a bag: its figures by the header stamps, and how it is read.

    ``frame_id`` is that of the poses, '' for joints and where it is not recorded; ``unit`` what
    the numbers look like; ``options`` take the motion from it. ``faults`` say why it will not do,
    or what it costs; ``will_do`` is whether it can be read with these options.
    """

    topic: str
    type: str
    frame_id: str
    unit: str
    quality: StreamQuality | None
    options: str
    faults: tuple[str, ...] = ()

    @property
    def will_do(self) -> bool:
        """Whether its motion can be read."""
        return self.quality is not None

    def to_dict(self) -> dict[str, object]:
        """All figures by name."""
        figures = {} if self.quality is None else vars(self.quality)
        own = {name: value for name, value in vars(self).items() if name != 'quality'}
        return own | figures | {'will_do': self.will_do}


@dataclass(frozen=True)
class BagSummary:
    """Topics of a bag, its sources of poses, and the possible trigger topics."""

    path: str
    topics: list[BagTopic]
    pose_streams: list[PoseSource]
    triggers: list[str]


def summarise(path: Path | str, max_pose_gap_s: float) -> BagSummary:
    """Summarise a bag; an interval longer than ``max_pose_gap_s`` is a gap."""
    with open_bag(path) as bag:
        sources = [
            *(_of_poses(bag, topic, max_pose_gap_s) for topic in pose_topics(bag)),
            *(_of_joints(bag, topic, max_pose_gap_s) for topic in bag.topics_of(JOINT_TYPE)),
            *_of_transforms(bag, max_pose_gap_s),
        ]
        triggers = [topic.name for topic in bag.topics_of(STATE_TYPE, BOOL_TYPE)]
        return BagSummary(str(path), bag.topics, [s for s in sources if s], triggers)


def _of_poses(bag: Bag, topic: BagTopic, max_gap_s: float) -> PoseSource | None:
    if not topic.message_count:
        return None
    options = f'--pose-topic {topic.name}'
    try:
        poses, log_times_ns, _ = read_poses(bag, topic.name)
    except RecordingError as error:
        return PoseSource(topic.name, topic.type, '', '', None, '', (str(error),))
    values = np.hstack([poses.positions_m, poses.quaternions_xyzw])
    quality = StreamQuality.of(poses.stamps_ns, values, log_times_ns, max_gap_s)
    unit = 'mm' if looks_like_mm(poses.positions_m) else 'm'
    options += ' --pose-unit mm' if unit == 'mm' else ''
    faults = tuple(quality.faults(topic.name))
    return PoseSource(topic.name, topic.type, poses.frame_id, unit, quality, options, faults)


def _of_joints(bag: Bag, topic: BagTopic, max_gap_s: float) -> PoseSource | None:
    """The joints that most messages of a topic have."""
    rows: dict[tuple[str, ...], list[tuple[int, int, list[float]]]] = {}
    for _, log_time_ns, message in bag.decoded([topic.name]):
        row = stamp_ns(message.header), log_time_ns, list(message.position)
        if len(row[2]) == len(message.name):
            rows.setdefault(tuple(message.name), []).append(row)
    if not rows:
        return None
    stamps, log_times, positions = zip(*max(rows.values(), key=len), strict=True)
    values = np.array(positions, dtype=float)
    logged = np.array(log_times, np.int64)
    quality = StreamQuality.of(np.array(stamps, np.int64), values, logged, max_gap_s)
    # Joints of a robot that is not known do not turn further [rad].
    unit = 'deg' if np.nanmax(np.abs(values), initial=0.0) > 4.0 * np.pi else 'rad'
    options = f'--urdf ROBOT --pose-topic {topic.name}'
    options += ' --angle-unit deg' if unit == 'deg' else ''
    faults = tuple(quality.faults(topic.name))
    return PoseSource(topic.name, topic.type, '', unit, quality, options, faults)


def _of_transforms(bag: Bag, max_gap_s: float) -> Iterator[PoseSource]:
    for edge in moving_transforms(bag):
        quality = StreamQuality.of(edge.stamps_ns, edge.poses, edge.log_times_ns, max_gap_s)
        name = f'{edge.parent} to {edge.child}'
        unit = 'mm' if looks_like_mm(edge.poses[:, :3]) else 'm'
        options = f'--tf {edge.parent} {edge.child}'
        options += ' --pose-unit mm' if unit == 'mm' else ''
        faults = tuple(quality.faults(name))
        yield PoseSource(name, 'transforms', edge.parent, unit, quality, options, faults)
