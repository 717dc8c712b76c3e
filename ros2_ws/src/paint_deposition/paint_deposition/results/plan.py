"""A plan on disk: bag, table, robot program, figures, and the film that is to be expected."""

import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from paint_deposition.errors import PaintError
from paint_deposition.files.atomic import write_text
from paint_deposition.files.gauge_readings import write_table
from paint_deposition.files.json_files import write_json
from paint_deposition.files.model_file import write_model
from paint_deposition.files.planned_model import DIGEST, MODEL_FILE, PLAN_FILE
from paint_deposition.files.provenance import model_digest
from paint_deposition.files.rapid.writer import module_text
from paint_deposition.files.recordings.bag_files import TRIGGER
from paint_deposition.files.recordings.bags import STATE_TOPIC, write_pose_bag
from paint_deposition.motion.part_frame import Rigid, moved
from paint_deposition.motion.programmed import Move
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.part.surface import Surface
from paint_deposition.planning.pass_motion import planned_moves
from paint_deposition.planning.plan import Plan
from paint_deposition.results.film import writable, write_film

COLUMNS = (
    'pass', 'x_m', 'y_m', 'z_m', 'qx', 'qy', 'qz', 'qw', 'speed_m_per_s', 'spraying',
)  # fmt: skip


def write_plan(
    folder: str | Path,
    plan: Plan,
    surface: Surface,
    details: Mapping[str, Any] | None = None,
    part: tuple[str, Rigid] | None = None,
) -> list[Path]:
    """Write ``plan.json``, bag, ``passes.csv``, ``passes.mod``, ``model.yaml`` and the film.

    An older plan in the folder is replaced.

    Args:
        folder: where to; made if it is not there.
        details: more to say in plan.json, such as the files used.
        part: the robot's frame and the pose of the part in it; bag and table have their poses
            in that frame then, and the module defines its work object so.

    Returns:
        The paths written.

    Raises:
        PaintError: the folder cannot be written, or holds another folder of the bag's name.
    """
    folder = Path(folder)
    moves = planned_moves(plan.passes, plan.style)
    with writable(folder):
        folder.mkdir(parents=True, exist_ok=True)
        digest = model_digest(plan.model)
        _write_bag(folder / 'trajectory', plan, digest, part)
        write_table(folder / 'passes.csv', _table(moves, part))
        comment = f'Planned with the model in {MODEL_FILE}, sha256 {digest}'
        module = module_text(moves, [comment], part[1] if part else None)
        write_text(folder / 'passes.mod', module)
        write_model(folder / MODEL_FILE, plan.model)
        told = {**plan.to_dict(), DIGEST: digest, **(details or {})}
        write_json(folder / PLAN_FILE, told)
    film = write_film(folder, surface, plan.film_um, plan.statistics, overwrite=True)
    names = [PLAN_FILE, 'trajectory', 'passes.csv', 'passes.mod', MODEL_FILE]
    names += [file.name for file in film]
    return [folder / name for name in names]


def _table(moves: Sequence[Move], part: tuple[str, Rigid] | None) -> Iterator[Sequence[object]]:
    """A line a move of the TCP: where it ends, how fast, and whether the gun is on."""
    yield COLUMNS
    number, was_spraying = 0, False
    for move in moves:
        number += move.spraying and not was_spraying
        was_spraying = move.spraying
        pose = move.position_m, move.quaternion_xyzw
        position, quaternion = part[1].applied(*pose) if part else pose
        yield [
            max(number, 1),
            *(f'{value:.6f}' for value in position),
            *(f'{value:.8f}' for value in quaternion),
            f'{move.speed_m_per_s:.6g}',
            int(move.spraying),
        ]


def _write_bag(target: Path, plan: Plan, digest: str, part: tuple[str, Rigid] | None) -> None:
    if target.exists():
        strangers = [
            path for path in target.rglob('*')
            if path.suffix not in ('.mcap', '.yaml') or path.is_dir()
        ]  # fmt: skip
        if not target.is_dir() or strangers:
            raise PaintError(f'{target} is there and no planned bag; move it away')
    # A bag's files are named for their folder, so the folder is made under its own name.
    with tempfile.TemporaryDirectory(dir=target.parent, prefix='.plan-') as aside:
        fresh = write_pose_bag(
            Path(aside) / target.name, _in_frame(plan.trajectory, part),
            custom_data={DIGEST: digest, TRIGGER: STATE_TOPIC},
            part=(plan.trajectory.frame_id, part[1]) if part else None,
        )  # fmt: skip
        if target.exists():
            shutil.rmtree(target)
        fresh.rename(target)
    write_model(target / MODEL_FILE, plan.model)


def _in_frame(trajectory: Trajectory, part: tuple[str, Rigid] | None) -> Trajectory:
    """The poses as the robot tells them."""
    if part is None:
        return trajectory
    frame_id, place = part
    return moved(trajectory, place, frame_id)
