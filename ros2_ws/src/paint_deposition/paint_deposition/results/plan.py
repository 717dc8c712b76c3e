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
from paint_deposition.files.rapid.writer import module_text
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.part.surface import Surface
from paint_deposition.planning.pass_motion import PlannedMove, planned_moves
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
    moves = planned_moves(plan.passes, plan.style)
    with writable(folder):
        folder.mkdir(parents=True, exist_ok=True)
        _write_bag(folder / 'trajectory', plan.trajectory)
        write_table(folder / 'passes.csv', _table(moves))
        write_text(folder / 'passes.mod', module_text(moves))
        write_json(folder / 'plan.json', {**plan.to_dict(), **(details or {})})
    film = write_film(folder, surface, plan.film_um, plan.statistics, overwrite=True)
    names = ['plan.json', 'trajectory', 'passes.csv', 'passes.mod', *(file.name for file in film)]
    return [folder / name for name in names]


def _table(moves: Sequence[PlannedMove]) -> Iterator[Sequence[object]]:
    """A line a move of the TCP: where it ends, how fast, and whether the gun is on."""
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
        ]


def _write_bag(target: Path, trajectory: Trajectory) -> None:
    if target.exists():
        strangers = [
            path for path in target.rglob('*')
            if path.suffix not in ('.mcap', '.yaml') or path.is_dir()
        ]  # fmt: skip
        if not target.is_dir() or strangers:
            raise PaintError(f'{target} is there and no planned bag; move it away')
    # A bag's files are named for their folder, so the folder is made under its own name.
    with tempfile.TemporaryDirectory(dir=target.parent, prefix='.plan-') as aside:
        fresh = write_pose_bag(Path(aside) / target.name, trajectory)
        if target.exists():
            shutil.rmtree(target)
        fresh.rename(target)
