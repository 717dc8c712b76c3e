"""What a run holds of the part in the cell, complete or not, to go on with its film."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from paint_msgs.msg import Part
from rclpy.serialization import deserialize_message

from paint_deposition.files.motion_files import read_gun_motions
from paint_deposition.files.motion_source import MotionSource
from paint_deposition.files.recordings.bag_files import open_bag
from paint_deposition.files.recordings.bags import POSE_TOPIC, STATE_TOPIC
from paint_deposition.files.recordings.mcap_recovery import recover
from paint_deposition.motion.trajectory import Trajectory


@dataclass(frozen=True)
class RecordedPart:
    """The motion of each gun in the frame of the part, and the part as it was announced."""

    motions: list[Trajectory]
    part: Part | None


def read_recorded_part(run: Path, guns: Sequence[str], frame_id: str) -> RecordedPart:
    """Read a run, also one that is still written, for guns by their names.

    Raises:
        RecordingError: nothing of it can be read.
    """
    with tempfile.TemporaryDirectory() as folder:
        copy = recover(run, Path(folder) / 'run').folder
        with open_bag(copy) as bag:
            named = {topic.name for topic in bag.topics if topic.message_count}
            told_on = bag.topics_of('paint_msgs/msg/Part')
            parts = [topic.name for topic in told_on if topic.message_count]
            told = [deserialize_message(m.cdr, Part) for m in bag.messages(parts)] if parts else []
        source = {'frame_id': frame_id}
        if list(guns) == ['']:
            # As the nodes take it: by the topics of the only gun.
            source['pose_topic'] = POSE_TOPIC
            source |= {'state_topic': STATE_TOPIC} if STATE_TOPIC in named else {}
        atomizers = [gun for gun in guns if gun]
        motions = read_gun_motions([copy], MotionSource(**source), atomizers)
        return RecordedPart([motion.trajectory for motion in motions], told[-1] if told else None)
