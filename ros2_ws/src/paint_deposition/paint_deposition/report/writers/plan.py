"""A plan on disk: bag, table, robot program, figures, and the film that is to be expected."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from paint_deposition.files.json_files import write_json
from paint_deposition.files.planned_model import DIGEST, PLAN_FILE
from paint_deposition.files.provenance import model_digest
from paint_deposition.motion.part_frame import Rigid
from paint_deposition.part.surface import Surface
from paint_deposition.planning.part_plan import PartPlan
from paint_deposition.planning.plan import Plan
from paint_deposition.report.writers.film import writable, write_film
from paint_deposition.report.writers.passes import Passes, write_passes


def write_plan(
    folder: str | Path,
    plan: Plan | PartPlan,
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
    with writable(folder):
        names = write_passes(
            folder, Passes(plan.trajectory, plan.moves, plan.model, 'Planned', part)
        )
        told = {**plan.to_dict(), DIGEST: model_digest(plan.model), **(details or {})}
        write_json(folder / PLAN_FILE, told)
    film = write_film(folder, surface, plan.film_um, plan.statistics, overwrite=True)
    names = [PLAN_FILE, *names, *(file.name for file in film)]
    return [folder / name for name in names]
