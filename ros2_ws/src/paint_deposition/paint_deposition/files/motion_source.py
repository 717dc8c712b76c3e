"""The options of campaigns and commands on which motion to read, and where the part stood."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, Field

from paint_deposition.errors import RecordingError
from paint_deposition.files.tables.pose_columns import ROTATION_WORDS, is_rotation
from paint_deposition.motion.part_frame import POSE_FORMAT, is_pose
from paint_deposition.motion.trajectory import DEFAULT_MAX_POSE_GAP_S

Text = Annotated[str, Field(min_length=1)]
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]


def _pose(values: list[float]) -> list[float]:
    if not is_pose(values):
        raise ValueError(f'{values} is no pose; give {POSE_FORMAT}')
    return values


def _rotation(name: str) -> str:
    if not is_rotation(name):
        raise ValueError(f'{name!r} is no convention; give {ROTATION_WORDS}')
    return name


class OnePart(BaseModel):
    """How the mesh of the part is read, and the motion over it."""

    mesh_scale: Number = Field(1.0, gt=0.0, description='metres per unit of the mesh')
    body: Text | None = Field(None, description='the name of the one body to take of the mesh')
    down: Annotated[list[Number], Field(min_length=3, max_length=3)] | None = Field(
        None, description='[x, y, z], the direction of gravity in the mesh frame'
    )
    max_pose_gap_s: Number = Field(
        DEFAULT_MAX_POSE_GAP_S, gt=0.0, description='longest gap between poses in a stroke [s]'
    )


class MotionSource(BaseModel, extra='forbid'):
    """What to read of a motion file, and the pose of the part; None: not given."""

    pose_topic: Text | None = Field(None, description='the name of a topic of the recording')
    state_topic: Text | None = Field(None, description='the name of a topic of the recording')
    gun_signal: Text | None = Field(None, description='the name of a digital output')
    procedure: Text | None = Field(None, description='the name of a procedure')
    tf: Annotated[list[Text], Field(min_length=2, max_length=2)] | None = Field(
        None, description='[target, source], the frame of the poses and the frame of the TCP'
    )
    urdf: Text | None = Field(None, description="the name of the robot's URDF file")
    tip_link: Text | None = Field(None, description='the name of the link that is the TCP')
    base_link: Text | None = Field(None, description='the name of the link in which the poses are')
    joint_prefix: Text | None = Field(
        None, description='what the names of the joints have before those of the URDF, or lack'
    )
    pose_unit: Literal['m', 'mm', 'cm'] | None = Field(
        None, description="'m', 'mm' or 'cm', the unit of recorded positions"
    )
    rotation: Annotated[Text, AfterValidator(_rotation)] | None = Field(
        None, description=ROTATION_WORDS
    )
    strict: bool = Field(
        False, description='true or false, whether to refuse what would be left out with a warning'
    )
    angle_unit: Literal['deg', 'rad'] | None = Field(
        None, description="'deg' or 'rad', the unit of recorded angles and joints"
    )
    tool_axis: Literal['x', 'y', 'z', '-x', '-y', '-z'] | None = Field(
        None, description='the axis of the recorded tool along which it sprays: x, ... or -z'
    )
    frame_id: Text | None = Field(None, description="the name of the part's frame")
    part_pose: Annotated[list[Number], AfterValidator(_pose)] | None = Field(
        None, description=f'the pose of the part in the frame of the poses, {POSE_FORMAT}'
    )

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
