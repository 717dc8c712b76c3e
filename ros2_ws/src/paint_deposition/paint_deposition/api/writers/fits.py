"""How a fitted model and what readings say of it are written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from paint_deposition.api.writers.provenance import provenance
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.files.json_files import write_json
from paint_deposition.files.model_file import ModelFile
from paint_deposition.inference.comparison.comparison import Comparison, SideBySide
from paint_deposition.inference.diagnosis.verdict import Diagnosis
from paint_deposition.inference.fitting.calibration import Calibration
from paint_deposition.inference.fitting.study import Study
from paint_deposition.report.data import ReportData
from paint_deposition.report.drawing import HERE, DrawingProcess, Here
from paint_deposition.report.page.report import write_report
from paint_deposition.report.writers.calibration import write_calibration
from paint_deposition.report.writers.fitted_model import write_fitted
from paint_deposition.report.writers.residual_mesh import file_name, write_residual_meshes
from paint_deposition.report.writers.residuals import write_residuals

PNG = 'png'
PROFILES = 'profiles:write_comparison_picture'


def calibration(
    result: Calibration, folder: str | Path, start: ModelFile | None = None, pictures: str = PNG
) -> list[Path]:
    made_with = _of_study(result.study, result.model)
    files = write_calibration(folder, result, start, made_with)
    drawn = HERE.start('calibration:write_calibration_pictures', folder, result, pictures)
    return files + drawn.result()


def comparison(
    result: Comparison,
    folder: str | Path,
    pictures: str = PNG,
    drawing: DrawingProcess | Here = HERE,
) -> list[Path]:
    return _write_report(Path(folder), 'comparison.json', result, result, pictures, drawing)


def side_by_side(
    result: SideBySide,
    folder: str | Path,
    pictures: str = PNG,
    drawing: DrawingProcess | Here = HERE,
) -> list[Path]:
    folder, data = Path(folder), ReportData.of(result)
    files = [folder / name for name in ('comparison.json', f'comparison.{pictures}')]
    drawn = drawing.start(PROFILES, files[1], data.charts)
    models = {name: comparison.model for name, comparison in result.by_name.items()}
    write_json(files[0], result.to_dict() | _of_study(data.study, models))
    for name, comparison in result.by_name.items():
        files.append(folder / f'residuals_{file_name(name)}.csv')
        write_residuals(files[-1], comparison)
    write_report(folder / 'report.html', data)
    drawn.result()
    return [*files, folder / 'report.html']


def diagnosis(
    result: Diagnosis,
    folder: str | Path,
    start: ModelFile | None = None,
    pictures: str = PNG,
    drawing: DrawingProcess | Here = HERE,
) -> list[Path]:
    folder, start = Path(folder), start or ModelFile(result.history[0].model)
    models = [folder / 'model_before.yaml', folder / 'model.yaml']
    write_fitted(models[0], result.study, result.history[:1], start)
    write_fitted(models[1], result.study, result.history, start)
    return models + _write_report(
        folder, 'diagnosis.json', result, result.comparisons[-1], pictures, drawing, start.history
    )


def _of_study(
    study: Study, model: DepositionModel | Mapping[str, DepositionModel]
) -> dict[str, Any]:
    campaign = study.campaign
    files = {'start model': campaign.model_file or ''}
    for experiment in campaign.experiments:
        files |= {f'{experiment.name}: {kind}': file for kind, file in experiment.files.items()}
    return provenance(model, files, campaign.name if Path(campaign.name).is_file() else '')


def _write_report(
    folder: Path,
    figures: str,
    result: Comparison | Diagnosis,
    last: Comparison,
    pictures: str,
    drawing: DrawingProcess | Here,
    older: Sequence[Mapping[str, Any]] = (),
) -> list[Path]:
    """Figures, the last model's residuals as a table and as meshes, picture and report."""
    data = ReportData.of(result, older)
    names = (figures, 'residuals.csv', f'comparison.{pictures}', 'report.html')
    files = [folder / name for name in names]
    drawn = drawing.start(PROFILES, files[2], data.charts)
    write_json(files[0], result.to_dict() | _of_study(last.study, last.model))
    write_residuals(files[1], last)
    meshes = write_residual_meshes(folder, last)
    write_report(files[3], data)
    drawn.result()
    return [*files, *meshes]
