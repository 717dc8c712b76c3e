"""What readings say of a model on disk: figures, residuals, the fitted model and the report."""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.files.atomic import write_json
from paint_deposition.files.gauge_readings import write_table
from paint_deposition.files.model_file import ModelFile
from paint_deposition.files.provenance import origin
from paint_deposition.inference.comparison.comparison import Comparison, SideBySide
from paint_deposition.inference.diagnosis.verdict import Diagnosis, Step
from paint_deposition.inference.fitting.calibration import Calibration
from paint_deposition.inference.fitting.study import Study
from paint_deposition.report.data import ReportData
from paint_deposition.report.page.report import write_report
from paint_deposition.report.pictures.comparison import comparison_figure
from paint_deposition.report.pictures.inference import write_calibration_pictures
from paint_deposition.report.style import save_picture
from paint_deposition.report.writers.models import write_fitted
from paint_deposition.report.writers.write import written


@written.register
def _write_calibration(
    result: Calibration, folder: Path, start: ModelFile | None = None, pictures: str = 'png'
) -> list[Path]:
    model_file, figures = folder / 'model.yaml', folder / 'calibration.json'
    study = result.study
    names = ', '.join(experiment.name for experiment in study.campaign.experiments)
    header = [
        f'Calibrated on {len(study)} points ({names}).',
        *(f'Warning: {warning}.' for warning in result.warnings),
    ]
    step = Step.of(study, '', result.fit)
    write_fitted(model_file, study, [step], start, '\n'.join(header))
    write_json(figures, result.to_dict() | _provenance(study, result.model))
    return [model_file, figures, *write_calibration_pictures(folder, result, pictures)]


@written.register(Comparison)
@written.register(SideBySide)
def _write_comparison(
    result: Comparison | SideBySide, folder: Path, pictures: str = 'png'
) -> list[Path]:
    figures = result.to_dict()
    return _write_results(folder, 'comparison.json', figures, ReportData.of(result), pictures)


@written.register
def _write_diagnosis(
    result: Diagnosis, folder: Path, start: ModelFile | None = None, pictures: str = 'png'
) -> list[Path]:
    start = start or ModelFile(result.history[0].model)
    models = [folder / 'model_before.yaml', folder / 'model.yaml']
    write_fitted(models[0], result.study, result.history[:1], start)
    write_fitted(models[1], result.study, result.history, start)
    data = ReportData.of(result, start.history)
    return models + _write_results(folder, 'diagnosis.json', result.to_dict(), data, pictures)


def _provenance(
    study: Study, model: DepositionModel | Mapping[str, DepositionModel]
) -> dict[str, Any]:
    campaign = study.campaign
    files = {'start model': campaign.model_file or ''}
    for experiment in campaign.experiments:
        files |= {f'{experiment.name}: {kind}': file for kind, file in experiment.files.items()}
    name = campaign.name if Path(campaign.name).is_file() else ''
    return {'provenance': origin(model, files, name)}


def _write_results(
    folder: Path, name: str, figures: dict[str, Any], data: ReportData, pictures: str
) -> list[Path]:
    """Figures, picture, report, and residuals: of the last model, or of each side by side."""
    beside = dict(zip(data.names, data.comparisons, strict=True)) if data.names else {}
    models = {name: comparison.model for name, comparison in beside.items()}
    residuals = {f'residuals_{file_name(name)}.csv': one for name, one in beside.items()}
    residuals = residuals or {'residuals.csv': data.comparisons[-1]}
    write_json(folder / name, figures | _provenance(data.study, models or data.model))
    for file, comparison in residuals.items():
        write_table(folder / file, _residual_rows(comparison))
    return [
        *(folder / file for file in (name, *residuals)),
        save_picture(comparison_figure(data), folder / f'comparison.{pictures}'),
        write_report(folder / 'report.html', data),
    ]


def _residual_rows(comparison: Comparison) -> Iterator[Sequence[str]]:
    """A heading and a row a reading; those that were left out are without a prediction."""
    yield (
        'experiment', 'point', 'group', 'x_m', 'y_m', 'z_m', 'thickness_um', 'predicted_um',
        'residual_um', 'sigma_um', 'used', 'layer',
    )  # fmt: skip
    found = comparison.readings
    fitted = zip(found.predicted_um, found.residual_um, found.sigma_um, strict=True)
    for experiment in comparison.study.campaign.experiments:
        readings = experiment.taken
        for k, used in enumerate(experiment.used):
            yield [
                experiment.name,
                str(readings.point[k]),
                str(readings.group[k]),
                *(f'{value:.5f}' for value in readings.positions_m[k]),
                f'{readings.thickness_um[k]:.3f}',
                *([f'{value:.3f}' for value in next(fitted)] if used else [''] * 3),
                str(int(used)),
                str(readings.layer[k]),
            ]


def file_name(name: str) -> str:
    """An experiment's name without what file systems do not like."""
    return re.sub(r'[^\w.-]+', '_', name).strip('._') or 'experiment'
