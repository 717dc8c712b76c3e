"""The options of campaigns and commands on which motion to read, and where the part stood."""

from pathlib import Path

from pydantic import field_validator

from paint_deposition.errors import RecordingError
from paint_deposition.files.tables.pose_columns import ROTATION_WORDS, is_rotation
from paint_deposition.motion.part_frame import POSE_FORMAT, is_pose
from paint_deposition.request import MotionOptions
from paint_deposition.request import Number as Number
from paint_deposition.request import OnePart as OnePart
from paint_deposition.request import Text as Text


class MotionSource(MotionOptions):
    """What to read of a motion file, and the pose of the part; None: not given."""

    @field_validator('part_pose')
    @classmethod
    def _is_pose(cls, values: list[float] | None) -> list[float] | None:
        if values is not None and not is_pose(values):
            raise ValueError(f'{values} is no pose; give {POSE_FORMAT}')
        return values

    @field_validator('rotation')
    @classmethod
    def _is_rotation(cls, name: str | None) -> str | None:
        if name is not None and not is_rotation(name):
            raise ValueError(f'{name!r} is no convention; give {ROTATION_WORDS}')
        return name

    def require_kind(self, path: Path, kind: str) -> None:
        """Refuse fields that do not apply to a kind of file, such as 'a bag'."""
        for name, kinds in MOTION_KINDS.items():
            if PLURAL[kind] not in kinds and getattr(self, name) is not None:
                option = f'--{name.replace("_", "-")}'
                raise RecordingError(f'{option} is for {kinds}, {path} is {kind}; leave it out')


PLURAL = {'a bag': 'bags', 'a table of poses': 'tables', 'a RAPID module': 'RAPID modules'}
# The fields that only some kinds of files have.
MOTION_KINDS = {
    'pose_topic': 'bags', 'tf': 'bags', 'state_topic': 'bags and tables', 'rotation': 'tables',
    **dict.fromkeys(('gun_signal', 'procedure'), 'RAPID modules'),
    **dict.fromkeys(
        ('urdf', 'tip_link', 'base_link', 'joint_prefix', 'pose_unit', 'angle_unit'),
        'bags and tables',
    ),
}  # fmt: skip
