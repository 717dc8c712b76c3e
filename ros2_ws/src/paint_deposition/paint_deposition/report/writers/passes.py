"""The motion of a plan or an improved programme on disk: bag, table and robot program."""

import shutil
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import PaintError
from paint_deposition.files.atomic import write_text
from paint_deposition.files.gauge_readings import write_table
from paint_deposition.files.model_file import write_model
from paint_deposition.files.provenance import DIGEST, MODEL_FILE, model_digest
from paint_deposition.files.rapid.program import module_text
from paint_deposition.files.recordings.bag_files import TRIGGER
from paint_deposition.files.recordings.bags import STATE_TOPIC, write_pose_bag
from paint_deposition.files.tool_path import write_tool_path
from paint_deposition.motion.part_frame import Rigid, moved
from paint_deposition.motion.programmed import Move
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.planning.driving import Drive

BAG, TABLE, PROGRAM, JOINTS = 'trajectory', 'passes.csv', 'passes.mod', 'joints.csv'
TOOL_PATH = 'passes.yaml'
COLUMNS = (
    'pass', 'x_m', 'y_m', 'z_m', 'qx', 'qy', 'qz', 'qw', 'speed_m_per_s', 'spraying', 'flow',
    'brush',
)  # fmt: skip


@dataclass(frozen=True)
class Passes:
    """A motion in the part's frame, timed and as moves of a robot program, and its model."""

    trajectory: Trajectory
    moves: Sequence[Move]
    model: DepositionModel
    made: str  # how, for the head of the program, as 'Planned'
    # The robot's frame and the pose of the part in it; bag and table have their poses in that
    # frame then, and the program defines its work object so. None: the part's frame.
    part: tuple[str, Rigid] | None = None
    drive: Drive | None = None  # the joints that drive it
    paint_moves: bool = False  # whether the program sprays by PaintL and SetBrush


def write_passes(folder: Path, passes: Passes) -> list[str]:
    """Write bag, ``passes.csv``, ``passes.mod`` and ``model.yaml`` to a folder; their names.

    Raises:
        PaintError: the folder holds another folder of the bag's name.
        OSError: it cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    digest, part = model_digest(passes.model), passes.part
    _write_bag(folder / BAG, passes, digest)
    write_table(folder / TABLE, _table(_in_frame(passes.moves, part)))
    comment = f'{passes.made} with the model in {MODEL_FILE}, sha256 {digest}'
    at = part[1] if part else None
    module = module_text(passes.moves, [comment], at, passes.paint_moves)
    write_text(folder / PROGRAM, module)
    write_tool_path(folder / TOOL_PATH, _in_frame(passes.moves, part))
    write_model(folder / MODEL_FILE, passes.model)
    if passes.drive:
        write_table(folder / JOINTS, _joint_table(passes.drive))
    return [BAG, TABLE, PROGRAM, TOOL_PATH, MODEL_FILE, *([JOINTS] if passes.drive else [])]


def _in_frame(moves: Sequence[Move], part: tuple[str, Rigid] | None) -> Sequence[Move]:
    if part is None:
        return moves
    poses = [part[1].applied(move.position_m, move.quaternion_xyzw) for move in moves]
    return [
        replace(move, position_m=position, quaternion_xyzw=quaternion)
        for move, (position, quaternion) in zip(moves, poses, strict=True)
    ]


def _table(moves: Sequence[Move]) -> Iterator[Sequence[object]]:
    """A line a move of the TCP: where it ends, how fast, and what the gun does."""
    yield COLUMNS
    number, was_spraying = 0, False
    for move in moves:
        number += move.spraying and not was_spraying
        was_spraying = move.spraying
        yield [
            max(number, 1),
            *(f'{value:.6f}' for value in move.position_m),
            *(f'{value:.8f}' for value in move.quaternion_xyzw),
            f'{move.speed_m_per_s:.6g}',
            int(move.spraying),
            f'{move.flow:.6g}' if move.spraying else 0,
            move.brush,
        ]


def _joint_table(drive: Drive) -> Iterator[Sequence[object]]:
    units = np.where(drive.arm.slides, 'm', 'rad')
    yield 'time_s', *(f'{name}_{unit}' for name, unit in zip(drive.arm.joints, units, strict=True))
    for time_s, values in zip(drive.seconds, drive.joints, strict=True):
        yield [f'{time_s:.4f}', *(f'{value:.7f}' for value in values)]


def _write_bag(target: Path, passes: Passes, digest: str) -> None:
    if target.exists():
        strangers = [
            path for path in target.rglob('*')
            if path.suffix not in ('.mcap', '.yaml') or path.is_dir()
        ]  # fmt: skip
        if not target.is_dir() or strangers:
            raise PaintError(f'{target} is there and no planned bag; move it away')
    trajectory, part = passes.trajectory, passes.part
    placed = moved(trajectory, part[1], part[0]) if part else trajectory
    # A bag's files are named for their folder, so the folder is made under its own name.
    with tempfile.TemporaryDirectory(dir=target.parent, prefix='.plan-') as aside:
        fresh = write_pose_bag(
            Path(aside) / target.name, placed,
            custom_data={DIGEST: digest, TRIGGER: STATE_TOPIC},
            part=(trajectory.frame_id, part[1]) if part else None, drive=passes.drive,
        )  # fmt: skip
        if target.exists():
            shutil.rmtree(target)
        fresh.rename(target)
    write_model(target / MODEL_FILE, passes.model)
