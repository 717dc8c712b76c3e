"""A calibration on disk: the model with its uncertainty, and figures."""

from pathlib import Path

from paint_deposition.diagnosis.verdict import Step
from paint_deposition.files.json_files import write_json
from paint_deposition.files.model_file import ModelFile
from paint_deposition.fitting.calibration import Calibration
from paint_deposition.results.fitted_model import write_fitted


def write_calibration(
    folder: str | Path, calibration: Calibration, start: ModelFile | None = None
) -> list[Path]:
    """Write ``model.yaml`` and ``calibration.json``; older ones are replaced.

    Args:
        folder: made if it is not there.
        calibration: what to write.
        start: the model it started from, whose name and history are carried on.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    study = calibration.study
    write_fitted(
        folder / 'model.yaml',
        study,
        [Step.of(study, '', calibration.fit)],
        start,
        '\n'.join(_headline(calibration)),
    )
    write_json(folder / 'calibration.json', calibration.to_dict())
    return [folder / 'model.yaml', folder / 'calibration.json']


def _headline(calibration: Calibration) -> list[str]:
    names = ', '.join(experiment.name for experiment in calibration.study.campaign.experiments)
    return [
        f'Calibrated on {len(calibration.study)} points ({names}).',
        *(f'Mind: {warning}.' for warning in calibration.warnings),
    ]
