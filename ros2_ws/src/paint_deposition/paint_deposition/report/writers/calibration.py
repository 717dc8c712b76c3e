"""A calibration on disk: the model with its uncertainty, and figures."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from paint_deposition.files.json_files import write_json
from paint_deposition.files.model_file import ModelFile
from paint_deposition.inference.diagnosis.verdict import Step
from paint_deposition.inference.fitting.calibration import Calibration
from paint_deposition.report.writers.fitted_model import write_fitted


def write_calibration(
    folder: str | Path,
    calibration: Calibration,
    start: ModelFile | None = None,
    details: Mapping[str, Any] | None = None,
) -> list[Path]:
    """Write ``model.yaml`` and ``calibration.json``; older ones are replaced.

    Args:
        folder: made if it is not there.
        calibration: what to write.
        start: the model it started from, whose name and history are carried on.
        details: more to say in calibration.json.
    """
    model_file, figures = Path(folder) / 'model.yaml', Path(folder) / 'calibration.json'
    study = calibration.study
    names = ', '.join(experiment.name for experiment in study.campaign.experiments)
    header = [
        f'Calibrated on {len(study)} points ({names}).',
        *(f'Mind: {warning}.' for warning in calibration.warnings),
    ]
    step = Step.of(study, '', calibration.fit)
    write_fitted(model_file, study, [step], start, '\n'.join(header))
    write_json(figures, calibration.to_dict() | dict(details or {}))
    return [model_file, figures]
