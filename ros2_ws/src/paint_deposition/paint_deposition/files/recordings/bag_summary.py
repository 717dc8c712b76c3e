"""A summary of a bag: its topics, and the quality of its streams of poses."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from paint_deposition.files.recordings.bag_files import BagTopic, open_bag
from paint_deposition.files.recordings.bags import POSE_TYPE, read_trajectory
from paint_deposition.files.recordings.message_definitions import STATE_TYPE
from paint_deposition.files.recordings.triggers import BOOL_TYPE
from paint_deposition.motion.path_builder import gap_ns


@dataclass(frozen=True)
class PoseStream:
    """Figures of one PoseStamped topic, from its header stamps."""

    topic: str
    frame_id: str
    poses: int
    duration_s: float
    mean_rate_hz: float
    gaps: int
    longest_gap_s: float
    repeated_stamps: int
    backward_stamps: int


@dataclass(frozen=True)
class BagSummary:
    """Topics of a bag, its pose streams, and the possible trigger topics."""

    path: str
    topics: list[BagTopic]
    pose_streams: list[PoseStream]
    triggers: list[str]


def summarise(path: Path | str, max_pose_gap_s: float) -> BagSummary:
    """Summarise a bag; an interval longer than ``max_pose_gap_s`` is a gap."""
    with open_bag(path) as bag:
        topics = bag.topics
        triggers = [topic.name for topic in bag.topics_of(STATE_TYPE, BOOL_TYPE)]
    streams = [
        _pose_stream(path, topic.name, max_pose_gap_s)
        for topic in bag.topics_of(POSE_TYPE)
        if topic.message_count
    ]
    return BagSummary(str(path), topics, streams, triggers)


def _pose_stream(path: Path | str, topic: str, max_pose_gap_s: float) -> PoseStream:
    trajectory = read_trajectory(path, topic)
    steps_ns = np.diff(trajectory.stamps_ns)
    gaps = int(np.count_nonzero(steps_ns > gap_ns(max_pose_gap_s)))
    duration_s = trajectory.duration_s
    rate_hz = len(steps_ns) / duration_s if duration_s > 0.0 else 0.0
    return PoseStream(
        topic, trajectory.frame_id, len(trajectory), duration_s, rate_hz, gaps,
        float(steps_ns.max(initial=0)) * 1e-9, int(np.count_nonzero(steps_ns == 0)),
        int(np.count_nonzero(steps_ns < 0)),
    )  # fmt: skip
