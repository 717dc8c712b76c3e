"""A summary of a bag: its topics, and whether each source of poses in it will do."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from paint_deposition.errors import RecordingError
from paint_deposition.files.recordings.bag_files import Bag, BagTopic, open_bag
from paint_deposition.files.recordings.headers import stamp_ns
from paint_deposition.files.recordings.message_definitions import JOINT_TYPE
from paint_deposition.files.recordings.pose_topics import (
    moving_transforms,
    pose_topics,
    read_poses,
)
from paint_deposition.motion.stream_quality import StreamQuality, looks_like_mm


@dataclass(frozen=True)
class PoseSource:
    """One source of poses in a bag: its figures by the header stamps, and how it is read.

    ``frame_id`` is that of the poses, '' for joints and where it is not recorded; ``unit`` what
    the numbers look like; ``options`` take the motion from it. ``faults`` say why it will not do,
    or what it costs.
    """

    topic: str
    type: str
    frame_id: str = ''
    unit: str = ''
    quality: StreamQuality | None = None  # None: its motion cannot be read
    options: str = ''
    faults: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, object]:
        """All figures by name."""
        figures = {} if self.quality is None else vars(self.quality)
        own = {name: value for name, value in vars(self).items() if name != 'quality'}
        return own | figures | {'will_do': self.quality is not None}


def summarise(path: Path | str, max_pose_gap_s: float) -> tuple[list[BagTopic], list[PoseSource]]:
    """The topics of a bag and its sources of poses; a longer interval is a gap."""
    with open_bag(path) as bag:
        return bag.topics, list(_sources(bag, max_pose_gap_s))


def _sources(bag: Bag, max_gap_s: float) -> Iterator[PoseSource]:
    """Topics of poses, then of joints, then transforms that move."""
    for topic in pose_topics(bag):
        if not topic.message_count:
            continue
        try:
            poses, logged, _ = read_poses(bag, topic.name)
        except RecordingError as error:
            yield PoseSource(topic.name, topic.type, faults=(str(error),))
            continue
        values = np.hstack([poses.positions_m, poses.quaternions_xyzw])
        quality = StreamQuality.of(poses.stamps_ns, values, logged, max_gap_s)
        options = f'--pose-topic {topic.name}'
        yield _of_poses(topic.name, topic.type, poses.frame_id, values, quality, options)
    for topic in bag.topics_of(JOINT_TYPE):
        rows: dict[tuple[str, ...], list[tuple[int, int, list[float]]]] = {}
        for _, log_time_ns, message in bag.decoded([topic.name]):
            row = stamp_ns(message.header), log_time_ns, list(message.position)
            if len(row[2]) == len(message.name):
                rows.setdefault(tuple(message.name), []).append(row)
        if rows:  # the joints that most messages have
            columns = zip(*max(rows.values(), key=len), strict=True)
            stamps, logged, joints = map(np.array, columns)
            quality = StreamQuality.of(stamps, joints.astype(float), logged, max_gap_s)
            # Joints of a robot that is not known do not turn further [rad].
            degrees = np.nanmax(np.abs(joints), initial=0.0) > 4.0 * np.pi
            options = f'--urdf ROBOT --pose-topic {topic.name}'
            options += ' --angle-unit deg' if degrees else ''
            unit, faults = 'deg' if degrees else 'rad', tuple(quality.faults(topic.name))
            yield PoseSource(topic.name, topic.type, '', unit, quality, options, faults)
    for edge in moving_transforms(bag):
        quality = StreamQuality.of(edge.stamps_ns, edge.poses, edge.log_times_ns, max_gap_s)
        name, options = f'{edge.parent} to {edge.child}', f'--tf {edge.parent} {edge.child}'
        yield _of_poses(name, 'transforms', edge.parent, edge.poses, quality, options)


def _of_poses(
    name: str, kind: str, frame_id: str, poses: np.ndarray, quality: StreamQuality, options: str
) -> PoseSource:
    unit = 'mm' if looks_like_mm(poses[:, :3]) else 'm'
    options += ' --pose-unit mm' if unit == 'mm' else ''
    return PoseSource(name, kind, frame_id, unit, quality, options, tuple(quality.faults(name)))
