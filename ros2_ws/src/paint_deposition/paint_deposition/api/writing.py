"""What the command line writes for each result: figures, meshes, pictures and the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import singledispatch
from pathlib import Path
from typing import Any

from paint_deposition.api.simulation import Film
from paint_deposition.comparison.comparison import Comparison
from paint_deposition.diagnosis.verdict import Diagnosis
from paint_deposition.files.gauge_readings import write_predictions
from paint_deposition.files.json_files import write_json
from paint_deposition.files.model_file import ModelFile
from paint_deposition.fitting.calibration import Calibration
from paint_deposition.motion.part_frame import Rigid
from paint_deposition.planning.plan import Plan
from paint_deposition.planning.recommendation import Recommendation
from paint_deposition.report.data import ReportData
from paint_deposition.report.page.report import write_report
from paint_deposition.report.pictures.calibration import write_calibration_pictures
from paint_deposition.report.pictures.film import write_door_picture
from paint_deposition.report.pictures.profiles import write_comparison_picture
from paint_deposition.report.pictures.uniformity import write_uniformity
from paint_deposition.results.calibration import write_calibration
from paint_deposition.results.film import write_film
from paint_deposition.results.fitted_model import write_fitted
from paint_deposition.results.plan import write_plan
from paint_deposition.results.residual_mesh import write_residual_meshes
from paint_deposition.results.residuals import write_residuals

# What a robot's own frame is called where nobody says (REP-105 and most URDFs).
ROBOT_FRAME = 'base_link'


@singledispatch
def write(result: Any, folder: str | Path, **more: Any) -> list[Path]:
    """Write a result as its command does, replacing older files of the same names.

    Args:
        result: what a verb of this package returned.
        folder: where to; made if it is not there.
        start: of a calibration or a diagnosis, the ``ModelFile`` that it started from: its name,
            history and uncertainties are carried on.
        made_from: of a film or a plan, more to say in its figures, such as the files used.
        part_pose, frame_id: of a plan, where the part stands in the robot's frame, [x y z qx qy qz
            qw], and the name of that frame; its files have their poses in that frame then.

    Returns:
        The paths written.
    """
    raise TypeError(f'{type(result).__name__} is not a result that can be written')


@write.register
def _(result: Film, folder: str | Path, made_from: Mapping[str, Any] | None = None) -> list[Path]:
    about = result.to_dict() | dict(made_from or {})
    files = write_film(
        folder, result.surface, result.film_um, result.statistics, details=about, overwrite=True
    )
    if result.readings is not None and result.predicted_um is not None:
        files.append(Path(folder) / 'predicted.csv')
        write_predictions(files[-1], result.readings.source, result.predicted_um)
    names = [Path(about.get(key, '')).name for key in ('mesh_file', 'trajectory', 'model_file')]
    picture = write_door_picture(
        Path(folder) / 'film.png', result.surface, result.film_um, result.path, result.statistics,
        f'Film on {names[0] or "the part"}', f'{names[1]}, {names[2] or "default model"}',
    )  # fmt: skip
    return [*files, picture]


@write.register
def _(result: Calibration, folder: str | Path, start: ModelFile | None = None) -> list[Path]:
    files = write_calibration(folder, result, start)
    return files + write_calibration_pictures(folder, result)


@write.register
def _(result: Comparison, folder: str | Path) -> list[Path]:
    return _write_report(Path(folder), 'comparison.json', result, result)


@write.register
def _(result: Diagnosis, folder: str | Path, start: ModelFile | None = None) -> list[Path]:
    folder, start = Path(folder), start or ModelFile(result.history[0].model)
    models = [folder / 'model_before.yaml', folder / 'model.yaml']
    write_fitted(models[0], result.study, result.history[:1], start)
    write_fitted(models[1], result.study, result.history, start)
    last = result.comparisons[-1]
    return models + _write_report(folder, 'diagnosis.json', result, last, start.history)


@write.register
def _(result: Recommendation, folder: str | Path) -> list[Path]:
    files = [Path(folder) / 'recommendation.json', Path(folder) / 'uniformity.png']
    write_json(files[0], result.to_dict())
    write_uniformity(files[1], result)
    return files


@write.register
def _(
    result: Plan,
    folder: str | Path,
    made_from: Mapping[str, Any] | None = None,
    part_pose: Sequence[float] | None = None,
    frame_id: str = ROBOT_FRAME,
) -> list[Path]:
    about = {'down': result.surface.down, 'notes': result.surface.notes} | dict(made_from or {})
    part = None if part_pose is None else (frame_id, Rigid.of(part_pose))
    files = write_plan(folder, result, result.surface, about, part)
    picture = write_door_picture(
        Path(folder) / 'film.png', result.surface, result.film_um, result.path,
        result.statistics, 'Planned passes and their film', result.sentence,
    )  # fmt: skip
    return [*files, picture]


def _write_report(
    folder: Path,
    figures: str,
    result: Comparison | Diagnosis,
    last: Comparison,
    older: Sequence[Mapping[str, Any]] = (),
) -> list[Path]:
    """Figures, the last model's residuals as a table and as meshes, picture and report."""
    data = ReportData.of(result, older)
    files = [folder / name for name in (figures, 'residuals.csv', 'comparison.png', 'report.html')]
    write_json(files[0], result.to_dict())
    write_residuals(files[1], last)
    meshes = write_residual_meshes(folder, last)
    write_comparison_picture(files[2], data)
    write_report(files[3], data)
    return [*files, *meshes]
