"""What the command line writes for each result: figures, meshes, pictures and the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import singledispatch
from pathlib import Path
from typing import Any

from paint_deposition.api.simulation import Film
from paint_deposition.comparison.comparison import Comparison, SideBySide
from paint_deposition.diagnosis.reading_choice import ChosenReadings
from paint_deposition.diagnosis.verdict import Diagnosis
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.files.gauge_readings import write_predictions
from paint_deposition.files.json_files import write_json
from paint_deposition.files.model_file import ModelFile
from paint_deposition.files.provenance import origin
from paint_deposition.film.spray_geometry import spray_geometry
from paint_deposition.fitting.calibration import Calibration
from paint_deposition.fitting.study import Study
from paint_deposition.motion.part_frame import Rigid
from paint_deposition.planning.improvement.improvement import Improvement
from paint_deposition.planning.part_plan import PartPlan
from paint_deposition.planning.plan import Plan
from paint_deposition.planning.recommendation import Recommendation
from paint_deposition.planning.trade_off import Point
from paint_deposition.report.data import ReportData
from paint_deposition.report.page.report import write_report
from paint_deposition.report.pictures.calibration import write_calibration_pictures
from paint_deposition.report.pictures.film import write_film_picture
from paint_deposition.report.pictures.geometry import write_geometry_picture
from paint_deposition.report.pictures.improvement import write_improvement_picture
from paint_deposition.report.pictures.measuring_points import write_measuring_picture
from paint_deposition.report.pictures.profiles import write_comparison_picture
from paint_deposition.report.pictures.trade_off import write_trade_off
from paint_deposition.report.pictures.uniformity import write_uniformity
from paint_deposition.results.calibration import write_calibration
from paint_deposition.results.film import write_film
from paint_deposition.results.fitted_model import write_fitted
from paint_deposition.results.improvement import write_improvement
from paint_deposition.results.measuring import write_chosen_readings
from paint_deposition.results.plan import write_plan
from paint_deposition.results.residual_mesh import file_name, write_residual_meshes
from paint_deposition.results.residuals import write_residuals
from paint_deposition.results.trade_off import write_trade_off_table

PNG = 'png'
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
        made_from: of a film, a plan, an improvement, chosen points or a recommendation, more to
            say in its figures, such as the files used.
        model: of a recommendation, what it was computed with.
        part_pose, frame_id: of a plan or an improvement, where the part stands in the robot's
            frame, [x y z qx qy qz qw], and the name of that frame; its files have their poses in
            that frame then. The first of them also of chosen points.
        trade_off: of plan or improvement, ``Point``s of other weights of the paint, for a table
            and a picture.

    Returns:
        The paths written.
    """
    raise TypeError(f'{type(result).__name__} is not a result that can be written')


@write.register
def _(
    result: Film,
    folder: str | Path,
    made_from: Mapping[str, Any] | None = None,
    pictures: str = PNG,
) -> list[Path]:
    about = result.to_dict() | dict(made_from or {})
    models = {gun.name or 'model': gun.model for gun in result.guns}
    motions = {f'{gun.name}: trajectory': gun.trajectory.source for gun in result.guns if gun.name}
    there = {what: file for what, file in motions.items() if Path(file).exists()}
    about |= _provenance(models, _files(about) | there)
    files = write_film(
        folder, result.surface, result.film_um, result.statistics, details=about, overwrite=True
    )
    if result.readings is not None and result.predicted_um is not None:
        files.append(Path(folder) / 'predicted.csv')
        write_predictions(files[-1], result.readings.source, result.predicted_um)
    names = [Path(about.get(key, '')).name for key in ('mesh_file', 'trajectory', 'model_file')]
    picture = write_film_picture(
        Path(folder) / f'film.{pictures}', result.surface, result.film_um, result.path,
        result.statistics, f'Film on {names[0] or "the part"}',
        f'{names[1]}, {names[2] or "default model"}',
    )  # fmt: skip
    return [*files, picture]


@write.register
def _(
    result: Calibration, folder: str | Path, start: ModelFile | None = None, pictures: str = PNG
) -> list[Path]:
    made_with = _of_study(result.study, result.model)
    files = write_calibration(folder, result, start, made_with)
    return files + write_calibration_pictures(folder, result, pictures)


@write.register
def _(result: Comparison, folder: str | Path, pictures: str = PNG) -> list[Path]:
    return _write_report(Path(folder), 'comparison.json', result, result, pictures)


@write.register
def _(result: SideBySide, folder: str | Path, pictures: str = PNG) -> list[Path]:
    folder, data = Path(folder), ReportData.of(result)
    files = [folder / name for name in ('comparison.json', f'comparison.{pictures}')]
    models = {name: comparison.model for name, comparison in result.by_name.items()}
    write_json(files[0], result.to_dict() | _of_study(data.study, models))
    write_comparison_picture(files[1], data)
    for name, comparison in result.by_name.items():
        files.append(folder / f'residuals_{file_name(name)}.csv')
        write_residuals(files[-1], comparison)
    write_report(folder / 'report.html', data)
    return [*files, folder / 'report.html']


@write.register
def _(
    result: Diagnosis, folder: str | Path, start: ModelFile | None = None, pictures: str = PNG
) -> list[Path]:
    folder, start = Path(folder), start or ModelFile(result.history[0].model)
    models = [folder / 'model_before.yaml', folder / 'model.yaml']
    write_fitted(models[0], result.study, result.history[:1], start)
    write_fitted(models[1], result.study, result.history, start)
    last = result.comparisons[-1]
    return models + _write_report(folder, 'diagnosis.json', result, last, pictures, start.history)


@write.register
def _(
    result: Recommendation,
    folder: str | Path,
    made_from: Mapping[str, Any] | None = None,
    model: DepositionModel | None = None,
    pictures: str = PNG,
) -> list[Path]:
    files = [Path(folder) / 'recommendation.json', Path(folder) / f'uniformity.{pictures}']
    write_json(files[0], result.to_dict() | _provenance(model, _files(made_from or {})))
    write_uniformity(files[1], result)
    return files


@write.register(Plan)
@write.register(PartPlan)
def _(
    result: Plan | PartPlan,
    folder: str | Path,
    made_from: Mapping[str, Any] | None = None,
    part_pose: Sequence[float] | None = None,
    frame_id: str = ROBOT_FRAME,
    pictures: str = PNG,
    trade_off: Sequence[Point] = (),
) -> list[Path]:
    about = {'down': result.surface.down, 'notes': result.surface.notes} | dict(made_from or {})
    about |= _provenance(result.model, _files(about))
    part = None if part_pose is None else (frame_id, Rigid.of(part_pose))
    files = write_plan(folder, result, result.surface, about, part)
    picture = write_film_picture(
        Path(folder) / f'film.{pictures}', result.surface, result.film_um, result.path,
        result.statistics, 'Planned passes and their film', result.sentence,
    )  # fmt: skip
    if isinstance(result, PartPlan):
        # The film is seen from one side, the passes from three. That they lie aside of the one
        # side that a part usually has is not odd here.
        geometry = spray_geometry(result.surface, result.path, result.model, frame_id)
        geometry = replace(geometry, warnings=tuple(map(str, result.contacts)))
        files.append(Path(folder) / f'passes.{pictures}')
        title = 'Planned passes over the faces'
        write_geometry_picture(files[-1], result.surface, result.path, geometry, title)
        return [*files, picture]
    plain = result.plain or result
    return [*files, picture, *_write_trade_off(Path(folder), plain.point, trade_off, pictures)]


@write.register
def _(
    result: Improvement,
    folder: str | Path,
    made_from: Mapping[str, Any] | None = None,
    part_pose: Sequence[float] | None = None,
    frame_id: str = ROBOT_FRAME,
    pictures: str = PNG,
    trade_off: Sequence[Point] = (),
) -> list[Path]:
    about = {'notes': (*result.surface.notes, *result.given.notes)} | dict(made_from or {})
    about |= _provenance(result.model, _files(about))
    part = None if part_pose is None else (frame_id, Rigid.of(part_pose))
    files = write_improvement(folder, result, about, part)
    files.append(write_improvement_picture(Path(folder) / f'improvement.{pictures}', result))
    return files + _write_trade_off(Path(folder), result.points[0], trade_off, pictures)


def _write_trade_off(
    folder: Path, given: Point, points: Sequence[Point], pictures: str
) -> list[Path]:
    """Table and picture, where other weights were tried."""
    if not points:
        return []
    return [
        write_trade_off_table(folder / 'pareto.csv', points),
        write_trade_off(folder / f'pareto.{pictures}', given, points),
    ]


@write.register
def _(
    result: ChosenReadings,
    folder: str | Path,
    made_from: Mapping[str, Any] | None = None,
    part_pose: Sequence[float] | None = None,
    pictures: str = PNG,
) -> list[Path]:
    about = {'down': result.surface.down, 'notes': result.surface.notes} | dict(made_from or {})
    about |= _provenance(result.model, _files(about))
    part = None if part_pose is None else Rigid.of(part_pose)
    files = write_chosen_readings(folder, result, about, part)
    return [*files, write_measuring_picture(Path(folder) / f'points.{pictures}', result)]


def _provenance(
    model: DepositionModel | Mapping[str, DepositionModel] | None,
    files: Mapping[str, str],
    campaign: str = '',
) -> dict[str, Any]:
    return {'provenance': origin(model, files, campaign)}


def _files(about: Mapping[str, Any]) -> dict[str, str]:
    """Of what a command says of its inputs, those that are files."""
    keys = ('mesh_file', 'mesh', 'trajectory', 'model_file', 'model')
    told = {key.removesuffix('_file'): str(about[key]) for key in keys if about.get(key)}
    return {what: file for what, file in told.items() if Path(file).exists()}


def _of_study(
    study: Study, model: DepositionModel | Mapping[str, DepositionModel]
) -> dict[str, Any]:
    campaign = study.campaign
    files = {'start model': campaign.model_file or ''}
    for experiment in campaign.experiments:
        files |= {f'{experiment.name}: {kind}': file for kind, file in experiment.files.items()}
    return _provenance(model, files, campaign.name if Path(campaign.name).is_file() else '')


def _write_report(
    folder: Path,
    figures: str,
    result: Comparison | Diagnosis,
    last: Comparison,
    pictures: str,
    older: Sequence[Mapping[str, Any]] = (),
) -> list[Path]:
    """Figures, the last model's residuals as a table and as meshes, picture and report."""
    data = ReportData.of(result, older)
    names = (figures, 'residuals.csv', f'comparison.{pictures}', 'report.html')
    files = [folder / name for name in names]
    write_json(files[0], result.to_dict() | _of_study(last.study, last.model))
    write_residuals(files[1], last)
    meshes = write_residual_meshes(folder, last)
    write_comparison_picture(files[2], data)
    write_report(files[3], data)
    return [*files, *meshes]
