"""A calibration on disk: the model with its uncertainty, and figures."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from paint_deposition.formats.json_files import write_json
from paint_deposition.formats.model_file import write_model
from paint_deposition.inference.calibration import Calibration, PanelFit
from paint_deposition.inference.unknowns import PATTERN_NAMES
from paint_deposition.model.uniformity import sigma_n_closed_form

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
        'experiments': [asdict(agreement) for agreement in calibration.agreements],
        'collapse': [
            None if panel is None else _collapse_as_dict(panel) for panel in calibration.panels
        ],
        'points': len(study),
        'readings': study.campaign.reading_count,
        'chi_square_per_degree_of_freedom': calibration.chi_square_per_freedom,
        'converged': calibration.fit.converged,
        'noise': {'sigma_um': study.noise.typical_um, 'source': study.noise.source},
        'warnings': list(calibration.warnings),
    }


def write_calibration(
    folder: str | Path, calibration: Calibration, history: Sequence[dict[str, Any]] = ()
) -> list[Path]:
    """Write ``model.yaml`` and ``calibration.json``; older ones are replaced."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    uncertainty: dict[str, Any] = {
        'planar': {
            value.name: float(f'{value.sigma:.3g}')
            for value in calibration.parameters
            if value.name in PATTERN_NAMES
        }
    }
    for value in calibration.parameters:
        if value.name not in PATTERN_NAMES:
            effect, _, name = value.name.partition('.')
            uncertainty.setdefault(effect, {})[name] = float(f'{value.sigma:.3g}')
    write_model(
        folder / 'model.yaml',
        calibration.model,
        header_comment='\n'.join(_headline(calibration)),
        history=history,
        uncertainty=uncertainty,
    )
    write_json(folder / 'calibration.json', calibration_as_dict(calibration))
    return [folder / 'model.yaml', folder / 'calibration.json']


def _headline(calibration: Calibration) -> list[str]:
    names = ', '.join(agreement.experiment for agreement in calibration.agreements)
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
        'rmse_um': panel.collapse.rmse_um,
        'speed_m_per_s': float(panel.panel.speed_m_per_s[0]),
    }
