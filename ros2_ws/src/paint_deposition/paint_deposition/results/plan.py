"""A plan on disk: bag, table, robot program, figures, and the film that is to be expected."""

import shutil
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from paint_deposition.errors import PaintError
from paint_deposition.files.atomic import write_text
from paint_deposition.files.gauge_readings import write_table
from paint_deposition.files.json_files import write_json
from paint_deposition.files.rapid.writer import module_text
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.part.surface import Surface
from paint_deposition.planning.pass_motion import planned_moves
from paint_deposition.planning.plan import Plan
from paint_deposition.results.film import write_film

BAG_FOLDER = 'trajectory'
COLUMNS = (
    'pass', 'x_m', 'y_m', 'z_m', 'qx', 'qy', 'qz', 'qw', 'speed_m_per_s', 'spraying',
)  # fmt: skip


def write_plan(
    folder: str | Path,
    plan: Plan,
    surface: Surface,
    details: Mapping[str, Any] | None = None,
) -> list[Path]:
    """Write ``plan.json``, bag, ``passes.csv``, ``passes.mod``, and the film's files.

    An older plan in the folder is replaced.

    Args:
        folder: where to; made if it is not there.
        details: more to say in plan.json, such as the files used.

    Returns:
        The paths written.

    Raises:
        PaintError: the folder cannot be written, or holds another folder of the bag's name.
    """
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        written = [
            _write_bag(folder, plan.trajectory),
            write_passes_csv(folder / 'passes.csv', plan),
            _write_module(folder / 'passes.mod', plan),
        ]
        write_json(folder / 'plan.json', {**plan.to_dict(), **(details or {})})
    except OSError as error:
        raise PaintError(
            f'{error.filename or folder}: {error.strerror}; choose a folder that can be written'
        ) from None
    film = write_film(folder, surface, plan.film_um, plan.statistics, overwrite=True)
    film = [folder / file.name for file in film]
    return [folder / 'plan.json', *written, *film]


def write_passes_csv(path: str | Path, plan: Plan) -> Path:
    """Write the TCP's moves as a table: where each ends, how fast, and whether the gun is on."""
    number, was_spraying = 0, False
    lines: list[Sequence[object]] = [COLUMNS]
    for move in planned_moves(plan.passes, plan.style):
        number += move.spraying and not was_spraying
        was_spraying = move.spraying
        lines.append(
            [
                max(number, 1),
                *(f'{value:.6f}' for value in move.position_m),
                *(f'{value:.8f}' for value in move.quaternion_xyzw),
                f'{move.speed_m_per_s:.6g}',
                int(move.spraying),
            ]
        )
    write_table(path, lines)
    return Path(path)


def _write_module(path: Path, plan: Plan) -> Path:
    write_text(path, module_text(planned_moves(plan.passes, plan.style)))
    return path


def _write_bag(folder: Path, trajectory: Trajectory) -> Path:
    target = folder / BAG_FOLDER
    if target.exists():
        strangers = [
            path for path in target.rglob('*')
            if path.suffix not in ('.mcap', '.yaml') or path.is_dir()
        ]  # fmt: skip
        if not target.is_dir() or strangers:
            raise PaintError(f'{target} is there and no planned bag; move it away')
    # A bag's files are named for their folder, so the folder is made under its own name.
    with tempfile.TemporaryDirectory(dir=folder, prefix='.plan-') as aside:
        fresh = write_pose_bag(Path(aside) / BAG_FOLDER, trajectory)
        if target.exists():
            shutil.rmtree(target)
        fresh.rename(target)
    return target
