"""Reading the motion of guns from files of any kind, in the frame of the part."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from paint_deposition.errors import RecordingError
from paint_deposition.files.rapid.program import is_rapid, program_trajectory, read_program
from paint_deposition.files.recordings.bag_files import TRIGGER, Bag, open_bag
from paint_deposition.files.recordings.bags import POSE_TOPIC, STATE_TOPIC, trajectory_of
from paint_deposition.files.recordings.messages import JOINT_TYPE
from paint_deposition.files.recordings.pose_topics import lookups, read_frames
from paint_deposition.files.tables.poses import is_pose_table, read_pose_table
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.motion.transforms import Rigid, at_part, is_frame
from paint_deposition.request import MotionOptions, validate

if TYPE_CHECKING:
    from paint_deposition.files.recordings.joint_states import Robot
    from paint_deposition.motion.transforms import FrameTree

PART = 'part'
# Programs that are not read, by their suffix: whose they are, and the convention of their angles.
OTHER_PROGRAMS = {
    **dict.fromkeys(('.src', '.dat'), ('KUKA', 'kuka')),
    **dict.fromkeys(('.ls', '.tp'), ('FANUC', 'fanuc')),
    **dict.fromkeys(('.urp', '.script'), ('Universal Robots', 'rotvec')),
}
# The fields that only some kinds of files have.
MOTION_KINDS = {
    'pose_topic': 'bags', 'tf': 'bags', 'state_topic': 'bags and tables', 'rotation': 'tables',
    **dict.fromkeys(('gun_signal', 'procedure'), 'RAPID modules'),
    **dict.fromkeys(
        ('urdf', 'tip_link', 'base_link', 'joint_prefix', 'pose_unit', 'angle_unit'),
        'bags and tables',
    ),
}  # fmt: skip


def require_kind(source: MotionOptions, path: Path, kind: str) -> None:
    """Refuse options that do not apply to a kind of file, such as 'a bag'."""
    plural = {'a bag': 'bags', 'a table of poses': 'tables', 'a RAPID module': 'RAPID modules'}
    for name, kinds in MOTION_KINDS.items():
        if plural[kind] not in kinds and getattr(source, name) is not None:
            option = f'--{name.replace("_", "-")}'
            raise RecordingError(f'{option} is for {kinds}, {path} is {kind}; leave it out')


def read_recording(
    path: str | Path,
    pose_topic: str | None = None,
    state_topic: str | None = None,
    gun_signal: str | None = None,
    **more: Any,
) -> Trajectory:
    """Read the poses and the trigger of a motion file, and transform them into the part's frame.

    Args:
        path: a bag, a RAPID module or a table of poses.
        pose_topic, state_topic: of a bag.
        gun_signal: digital output that opens the gun; for RAPID modules only.
        more: the other fields of ``MotionOptions``, such as ``part_pose``.

    Raises:
        RecordingError: the file, an option, or the frame of the poses is wrong.
    """
    given = {'pose_topic': pose_topic, 'state_topic': state_topic, 'gun_signal': gun_signal}
    return read_motion(path, validate(MotionOptions, 'motion', given | more, RecordingError))


def read_motion(path: str | Path, source: MotionOptions, gun: str = '') -> Trajectory:
    """``read_recording`` with the options of a campaign or the command line.

    ``gun`` is the name that precedes the gun's topics in the bag, '' for none.
    """
    path = Path(path)
    if is_rapid(path):
        require_kind(source, path, 'a RAPID module')
        program = read_program(path, source.gun_signal, source.procedure)
        try:
            recorded = program_trajectory(program)
        except RecordingError as error:
            raise RecordingError(f'{path}: {error}') from None
    elif is_pose_table(path):
        recorded = read_table(path, source)
    elif maker := OTHER_PROGRAMS.get(path.suffix.lower()):
        raise RecordingError(
            f'{path} is a program for {maker[0]}, which is not read; export the motion from its '
            'simulation or a trace as a table with x, y, z, the three angles and time_s (or '
            f'speed_m_per_s), and say --rotation {maker[1]}'
        )
    else:
        require_kind(source, path, 'a bag')
        with open_bag(path) as bag:
            recorded = replace(_read_bag(bag, source, gun), source=str(path))
            brought = _in_part_frame(recorded, source, bag)
            skipped = tuple(f'{path}: {n} {what}: left out' for what, n in bag.skipped.items())
            if skipped and source.strict:
                raise RecordingError(f'{skipped[0]}; mend the recording, or leave out --strict')
            warnings = (*brought.warnings, *bag.warnings, *skipped)
            return _turned(replace(brought, warnings=warnings), source)
    return _turned(_in_part_frame(replace(recorded, source=str(path)), source, None), source)


def _turned(recorded: Trajectory, source: MotionOptions) -> Trajectory:
    """The motion with the axis along which the tool sprays as its z."""
    if not source.tool_axis:
        return recorded
    sign, axis = (-1.0 if source.tool_axis[0] == '-' else 1.0), 'xyz'.index(source.tool_axis[-1])
    turn, _ = Rotation.align_vectors([sign * np.eye(3)[axis]], [[0.0, 0.0, 1.0]])
    # Of unchanged norm, by which damaged ones are known.
    turned = recorded.quaternions_xyzw.copy()
    norms = np.linalg.norm(turned, axis=1)
    rows = (norms > 0.0) & np.isfinite(norms)
    turned[rows] = norms[rows, np.newaxis] * (Rotation.from_quat(turned[rows]) * turn).as_quat()
    notes = (*recorded.notes, f'its tool sprays along {source.tool_axis}')
    return replace(recorded, quaternions_xyzw=turned, notes=notes)


def holds_joints(path: Path) -> bool:
    """Whether the motion in a file may be that of joints, for which the robot has to be known."""
    if is_pose_table(path) or is_rapid(path):
        return False
    with open_bag(path) as bag:
        return bool(bag.topics_of(JOINT_TYPE))


def read_table(path: Path, source: MotionOptions) -> Trajectory:
    """The motion in a table, in the frame of its poses."""
    require_kind(source, path, 'a table of poses')
    return read_pose_table(path, source, _robot(path, source))


def read_gun_motions(
    files: Sequence[Path], source: MotionOptions, atomizers: Sequence[str] = ()
) -> list[tuple[str, Trajectory]]:
    """The name of each gun, '' for the only one, and its motion, from a file for each.

    Or from one bag with all ``atomizers``, whose names precede their topics, as in
    /robot_1/atomizer/pose; a gun without a recorded state sprays whenever it moves. Raises
    RecordingError if names and files do not match, or a file cannot be read.
    """
    guns = [name.strip('/') for name in atomizers]
    names = guns or [file.stem for file in files]
    if guns and len(files) not in (1, len(guns)):
        raise RecordingError(
            f'{len(files)} files for {len(guns)} atomizers: give one with all of them, or one for '
            'each'
        )
    if len(guns) > len(files) and (is_rapid(files[0]) or is_pose_table(files[0])):
        raise RecordingError(
            f'{files[0]} is no bag and has the motion of one gun, not of {len(guns)} atomizers; '
            'give a file for each'
        )
    if guns and (source.pose_topic or source.state_topic):
        raise RecordingError(
            'an atomizer is given by its name and by topics: leave out --atomizer, or '
            '--pose-topic and --state-topic'
        )
    if not guns and len(files) == 1:
        names = ['']
    elif not guns and len(set(names)) < len(names):
        names = [f'{name} {number}' for number, name in enumerate(names, start=1)]
    each = list(files) * (len(names) if len(files) == 1 else 1)
    of_each = zip(names, each, guns or [''] * len(each), strict=True)
    return [(name, read_motion(file, source, gun)) for name, file, gun in of_each]


def _read_bag(bag: Bag, source: MotionOptions, gun: str) -> Trajectory:
    """The motion in a bag, in the frame of its poses."""
    robot = _robot(bag.path, source)
    if robot and source.tf:
        raise RecordingError(f'{bag.path}: both tf and urdf are given; leave one of them out')
    poses, trigger, notes = source.pose_topic, source.state_topic, tuple[str, ...]()
    if gun:
        state = bag.find(f'/{gun}{STATE_TOPIC}')
        poses, trigger = f'/{gun}{POSE_TOPIC}', state.name if state else None
    elif not trigger and (trigger := bag.custom_data.get(TRIGGER)):
        # The bag of a plan names its trigger itself.
        notes = (f'a plan: its trigger {trigger} is used',)
    recorded = trajectory_of(bag, poses, trigger, source.tf, robot, source.pose_unit)
    return replace(recorded, notes=(*recorded.notes, *notes))


def _robot(path: Path, source: MotionOptions) -> 'Robot | None':
    """The robot whose joints the recording has, None where it has poses."""
    if not source.urdf:
        if source.tip_link or source.base_link or source.joint_prefix:
            raise RecordingError(
                f'{path}: tip_link, base_link and joint_prefix go with a URDF; give --urdf'
            )
        return None
    from paint_deposition.files.recordings.joint_states import Robot

    robot = Robot.read(Path(source.urdf), source.tip_link, source.base_link)
    return replace(
        robot, joint_prefix=source.joint_prefix or '', angle_unit=source.angle_unit,
        length_unit=source.pose_unit,
    )  # fmt: skip


def _in_part_frame(recorded: Trajectory, source: MotionOptions, bag: Bag | None) -> Trajectory:
    """Transform by the given pose of the part, else by the transforms of the recording."""
    named, part = recorded.frame_id, source.frame_id or PART
    recorded = replace(recorded, read_in=named)
    if source.part_pose is not None and not recorded.frames:
        if source.frame_id and named and is_frame(named, part):
            raise RecordingError(
                f"{recorded.source}: its poses are in '{named}', which is said to be the part's "
                'own frame, and a part_pose is given; leave one of them out'
            )
        of = f"'{named}'" if named else 'their own frame'
        note = f'part_pose: poses brought from {of} to the part, which stands at '
        note += words(Rigid.of(source.part_pose))
        brought = at_part(recorded, source.part_pose, part)
        return replace(brought, notes=(*brought.notes, note))
    known = ''
    if bag is not None and (recorded.frames or not is_frame(named, part)):
        tree = read_frames(bag)
        recorded = _by_transforms(recorded, part, tree, bag, source.part_pose)
        others = (name for name in tree.names if name != named.lstrip('/'))
        fixed = [name for name in others if tree.moving_between(named, name) == set()]
        known = f' (static transforms connect it to {", ".join(fixed)})' if fixed else ''
    if is_frame(recorded.frame_id, part):
        return recorded
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


def _by_transforms(
    recorded: Trajectory, part: str, tree: 'FrameTree', bag: Bag,
    part_pose: Sequence[float] | None,
) -> Trajectory:  # fmt: skip
    """Each pose in the frame of the part by where that is at its time, as the nodes do it.

    A pose without a frame is the part's. If nothing places the part, it is the most frequent
    frame of the poses; poses for which no transform is known are left out.
    """
    named = recorded.frame_id
    frames = np.array(recorded.frames or [named] * len(recorded))
    own = [frame for frame in {*frames.tolist()} if is_frame(frame, part)]
    others = Counter(frame for frame in frames.tolist() if frame not in own)
    if part_pose is not None and others:
        tree.place(part, others.most_common(1)[0][0], part_pose)
    between = tree.moving_between(named, part)
    placed = any(tree.moving_between(frame, part) is not None for frame in others)
    target = part if own or placed else named
    taken = np.isin(frames, [*own, target])
    positions, quaternions = recorded.positions_m.copy(), recorded.quaternions_xyzw.copy()
    for frame in sorted(others.keys() - {target}):
        (rows,) = np.nonzero(frames == frame)
        if tree.moving_between(frame, target) == set():
            transforms = [tree.lookup(frame, target)] * len(rows)
        else:
            found, transforms = lookups(tree, frame, target, recorded.stamps_ns[rows])
            if lost := np.count_nonzero(~found):
                what = f"poses in frame '{frame}', of which '{target}' is not known at their time"
                bag.skipped[f'{what} (record /tf from before the first pose on)'] += int(lost)
            rows = rows[found]
        for row, transform in zip(rows, transforms, strict=True):
            positions[row], quaternions[row] = transform.applied(positions[row], quaternions[row])
        taken[rows] = True
    if not taken.any():
        raise RecordingError(
            f"{recorded.source}: the transforms of '{target}' in '{named}' cover none of its "
            'poses; their clock is another, give --part-pose'
        )
    notes = recorded.notes
    if between == set() and not recorded.frames:
        place = words(tree.lookup(part, named))
        note = f"static transforms: poses brought from '{named}' to '{part}', which stands at "
        notes = (*notes, note + place)
    elif between and not recorded.frames:
        frames_of = f"'{part}' in '{named}'"
        notes = (*notes, f'/tf: {taken.sum()} poses brought to the moving part, {frames_of}')
    return replace(
        recorded, stamps_ns=recorded.stamps_ns[taken], positions_m=positions[taken],
        quaternions_xyzw=quaternions[taken], frame_id=target, frames=(), notes=notes,
        trigger_rows=np.searchsorted(np.flatnonzero(taken), recorded.trigger_rows),
    )  # fmt: skip


def words(place: Rigid) -> str:
    """A pose in the format of the options."""
    return ' '.join(f'{value + 0.0:.6g}' for value in place.values)
