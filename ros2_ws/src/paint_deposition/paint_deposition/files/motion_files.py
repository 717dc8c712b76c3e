"""Motions by the kind of their file, brought into the frame of the part."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from paint_deposition.errors import RecordingError
from paint_deposition.files.motion_source import MotionSource
from paint_deposition.files.pose_tables.reading import PoseLayout, is_pose_table, read_pose_table
from paint_deposition.files.rapid.motion import is_rapid, program_trajectory
from paint_deposition.files.rapid.program import read_program
from paint_deposition.files.recordings.bag_files import TRIGGER, custom_data
from paint_deposition.files.recordings.bags import read_trajectory
from paint_deposition.files.refusals import checked
from paint_deposition.motion.part_frame import Rigid, at_part, is_frame
from paint_deposition.motion.trajectory import Trajectory

if TYPE_CHECKING:
    from paint_deposition.files.recordings.joint_states import Robot
    from paint_deposition.files.recordings.transforms import StaticFrames

PART = 'part'


def read_recording(
    path: str | Path,
    pose_topic: str | None = None,
    state_topic: str | None = None,
    gun_signal: str | None = None,
    **more: Any,
) -> Trajectory:
    """Read the poses and the trigger of a motion file, and bring them into the part's frame.

    Args:
        path: a bag, a RAPID module or a table of poses.
        pose_topic, state_topic: of a bag.
        gun_signal: digital output that opens the gun; for RAPID modules only.
        more: the other fields of ``MotionSource``, ``part_pose`` say.

    Raises:
        RecordingError: what the readers of these files refuse, an option that is another kind of
            file's, or poses in another frame than the one named.
    """
    given = {'pose_topic': pose_topic, 'state_topic': state_topic, 'gun_signal': gun_signal}
    return read_motion(path, checked(MotionSource, 'motion', given | more, RecordingError))


def read_motion(path: str | Path, source: MotionSource) -> Trajectory:
    """The same with the options as they come from a campaign or the command line."""
    path = Path(path)
    if is_rapid(path):
        source.refuse_other(path, 'a RAPID module', 'gun_signal')
        recorded = program_trajectory(read_program(path, gun_signal=source.gun_signal))
    elif is_pose_table(path):
        source.refuse_other(
            path, 'a table of poses', 'state_topic', 'pose_unit', 'rotation', 'angle_unit'
        )
        layout = PoseLayout(
            source.state_topic, source.pose_unit, source.rotation, source.angle_unit
        )
        recorded = read_pose_table(path, layout)
    else:
        source.refuse_other(
            path, 'a bag', 'pose_topic', 'state_topic', 'tf', 'urdf', 'tip_link', 'base_link'
        )
        # A plan's bag says itself what its trigger is.
        planned = custom_data(path).get(TRIGGER)
        trigger = source.state_topic or planned
        recorded = read_trajectory(
            path, source.pose_topic, trigger, source.tf, _robot(path, source)
        )
        if planned and not source.state_topic:
            recorded = _noted(recorded, f'a plan: its trigger {planned} is used')
    return _brought_to_part(replace(recorded, source=str(path)), source)


def _robot(path: Path, source: MotionSource) -> Robot | None:
    """The robot whose joints are recorded, None where poses are."""
    if source.urdf and source.tf:
        raise RecordingError(f'{path}: both tf and urdf are given; leave one of them out')
    if source.urdf:
        from paint_deposition.files.recordings.joint_states import Robot

        return Robot.read(Path(source.urdf), source.tip_link, source.base_link)
    if source.tip_link or source.base_link:
        raise RecordingError(f'{path}: tip_link and base_link are links of a URDF; give --urdf')
    return None


def _brought_to_part(recorded: Trajectory, source: MotionSource) -> Trajectory:
    """By the pose of the part that is given, else by the transforms of the recording."""
    named, part = recorded.frame_id, source.frame_id or PART
    if source.part_pose is not None:
        if source.frame_id and named and is_frame(named, part):
            raise RecordingError(
                f"{recorded.source}: its poses are in '{named}', which is said to be the part's "
                'own frame, and a part_pose is given; leave one of them out'
            )
        of = f"'{named}'" if named else 'their own frame'
        said = f'part_pose: poses brought from {of} to the part, which stands at '
        said += words(Rigid.of(source.part_pose))
        return _noted(at_part(recorded, source.part_pose, part), said)
    if is_frame(named, part):
        return recorded
    path = Path(recorded.source)
    static = _static_frames(path)
    place = static.pose_of(part, named)
    if place is not None:
        said = f"static transforms: poses brought from '{named}' to '{part}', which stands at "
        return _noted(at_part(recorded, place.values, part), said + words(place))
    from paint_deposition.files.recordings.transforms import poses_over_time

    if _has_frames(path) and (over_time := poses_over_time(path, part, named, recorded.stamps_ns)):
        return _on_a_moving_part(recorded, part, *over_time)
    known = static.words(named)
    if source.frame_id:
        raise RecordingError(
            f"{recorded.source}: its poses are in frame '{named}', the mesh in '{part}', and no "
            f'transform between them is recorded{known}; give --part-pose'
        )
    warning = (
        f"{recorded.source}: its poses are in frame '{named}' and are taken as if the mesh were "
        f"in it too, not in '{part}'{known}; if it is, say --frame-id {named}, else give "
        '--part-pose or the frame of the part (--frame-id)'
    )
    return replace(recorded, warnings=(*recorded.warnings, warning))


def _on_a_moving_part(
    recorded: Trajectory, part: str, known: np.ndarray, places: np.ndarray
) -> Trajectory:
    """By the pose of the part at the time of each pose, (M, 7) where it is known (N,)."""
    frames = f"'{part}' in '{recorded.frame_id}'"
    if not known.any():
        raise RecordingError(
            f'{recorded.source}: the transforms of {frames} cover none of its poses; their clock '
            'is another, give --part-pose'
        )
    # One by one, as the nodes do, so that the film is the same.
    poses = zip(recorded.positions_m[known], recorded.quaternions_xyzw[known], strict=True)
    brought = [
        Rigid.of(place).inverse().applied(*pose) for place, pose in zip(places, poses, strict=True)
    ]
    positions, quaternions = map(np.array, zip(*brought, strict=True))
    moved = replace(
        recorded,
        stamps_ns=recorded.stamps_ns[known],
        positions_m=positions,
        quaternions_xyzw=quaternions,
        frame_id=part,
    )
    if left_out := len(recorded) - len(moved):
        warning = (
            f'{recorded.source}: {left_out} of {len(recorded)} poses are left out, since the '
            f'transforms of {frames} do not cover their time; record /tf from before the first'
            ' pose on'
        )
        moved = replace(moved, warnings=(*moved.warnings, warning))
    return _noted(moved, f'/tf: {len(moved)} poses brought to the moving part, {frames}')


def _static_frames(path: Path) -> StaticFrames:
    from paint_deposition.files.recordings.transforms import StaticFrames

    return StaticFrames.of(path) if _has_frames(path) else StaticFrames()


def _has_frames(path: Path) -> bool:
    """Only bags tell of frames."""
    return not is_rapid(path) and not is_pose_table(path)


def words(place: Rigid) -> str:
    """A pose as options take it."""
    return ' '.join(f'{value + 0.0:.6g}' for value in place.values)


def _noted(trajectory: Trajectory, note: str) -> Trajectory:
    return replace(trajectory, notes=(*trajectory.notes, note))
