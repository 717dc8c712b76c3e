"""A calibration on disk: the model with its uncertainty, and figures."""

from pathlib import Path
from typing import Any

from paint_deposition.diagnosis.verdict import Step
from paint_deposition.files.json_files import write_json
from paint_deposition.files.model_file import ModelFile
from paint_deposition.fitting.calibration import Calibration, PanelFit
from paint_deposition.model.uniformity import sigma_n_closed_form
from paint_deposition.results.fitted_model import write_fitted

SHOWN_CORRELATIONS = 10


def calibration_as_dict(calibration: Calibration) -> dict[str, Any]:
    """Figures of a calibration."""
    study = calibration.study
    return {
        'parameters': {
            value.name: {
                'value': value.value,
                'sigma': value.sigma,
                'low': value.low,
                'high': value.high,
                'determined': value.determined,
            }
            for value in calibration.parameters
        },
        'correlations': [
            {'parameters': [pair.first, pair.second], 'value': pair.value}
            for pair in calibration.correlations[:SHOWN_CORRELATIONS]
        ],
        'experiments': [
            {
                'experiment': experiment.name,
                'points': len(residuals),
                'measured_mean_um': float(residuals.measured_um.mean()),
                'predicted_mean_um': float(residuals.predicted_um.mean()),
                'residual_sd_um': residuals.sd_um,
                'rmse_um': residuals.rmse_um,
            }
            for experiment, residuals in zip(
                study.campaign.experiments, calibration.residuals, strict=True
            )
        ],
        'collapse': [
            None if panel is None else _collapse_as_dict(panel) for panel in calibration.panels
        ],
        'points': len(study),
        'readings': len(study.campaign.readings),
        'chi_square_per_degree_of_freedom': calibration.chi_square_per_freedom,
        'converged': calibration.fit.converged,
        'noise': {'sigma_um': study.noise.typical_um, 'source': study.noise.source},
        'warnings': list(calibration.warnings),
    }


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
    write_json(folder / 'calibration.json', calibration_as_dict(calibration))
    return [folder / 'model.yaml', folder / 'calibration.json']


def _headline(calibration: Calibration) -> list[str]:
    names = ', '.join(experiment.name for experiment in calibration.study.campaign.experiments)
    return [
        f'Calibrated on {len(calibration.study)} points ({names}).',
        *(f'Mind: {warning}.' for warning in calibration.warnings),
    ]


def _collapse_as_dict(panel: PanelFit) -> dict[str, Any]:
    """Eq. (3), and eq. (5) for it at the panel's own index if it has one."""
    collapse, index = panel.collapse.collapse, None
    if len(panel.panel.passes_m) > 1:
        index = panel.panel.scale_m
    return {
        **collapse.model_dump(),
        'index_m': index,
        'sigma_n': None if index is None else sigma_n_closed_form(collapse, index),
        'rmse_um': panel.collapse.residuals.rmse_um,
        'speed_m_per_s': float(panel.panel.speed_m_per_s[0]),
    }
