"""An improved programme on disk: bag, table, robot program, figures and the film to expect."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from paint_deposition.files.json_files import write_json
from paint_deposition.files.planned_model import DIGEST, IMPROVEMENT_FILE
from paint_deposition.files.provenance import model_digest
from paint_deposition.film.statistics import film_statistics
from paint_deposition.motion.part_frame import Rigid
from paint_deposition.planning.improvement.improvement import Improvement
from paint_deposition.report.writers.film import writable, write_film
from paint_deposition.report.writers.passes import Passes, write_passes


def write_improvement(
    folder: str | Path,
    result: Improvement,
    details: Mapping[str, Any] | None = None,
    part: tuple[str, Rigid] | None = None,
) -> list[Path]:
    """Write ``improvement.json``, bag, ``passes.csv``, ``passes.mod``, model and film.

    Args:
        folder: where to; made if it is not there.
        details: more to say in the figures, such as the files used.
        part: the robot's frame and the pose of the part in it, as for a plan.

    Returns:
        The paths written.

    Raises:
        PaintError: the folder cannot be written, or holds another folder of the bag's name.
    """
    folder = Path(folder)
    passes = Passes(result.trajectory, result.moves, result.model, 'Improved', part)
    with writable(folder):
        names = write_passes(folder, passes)
        told = {**result.to_dict(), DIGEST: model_digest(result.model), **(details or {})}
        write_json(folder / IMPROVEMENT_FILE, told)
    off = result.tolerance * result.target_um
    statistics = film_statistics(
        result.after.film_um, result.surface.vertex_areas_m2, result.after.paint_cm3,
        target_um=result.target_um, target_tolerance_um=off,
    )  # fmt: skip
    film = write_film(folder, result.surface, result.after.film_um, statistics, overwrite=True)
    return [folder / name for name in (IMPROVEMENT_FILE, *names)] + film
