"""Residuals as CSV; column names as others rely on them."""

from pathlib import Path

from paint_deposition.files.gauge_readings import write_table
from paint_deposition.inference.comparison.comparison import Comparison


def write_residuals(path: str | Path, comparison: Comparison) -> None:
    """Write a row a reading: where, measured, predicted, residual and its uncertainty.

    Readings that were left out are there, too, without a prediction.
    """
    lines = [
        ['experiment', 'point', 'group', 'x_m', 'y_m', 'z_m', 'thickness_um', 'predicted_um',
         'residual_um', 'sigma_um', 'used']
    ]  # fmt: skip
    found = comparison.readings
    fitted = zip(found.predicted_um, found.residual_um, found.sigma_um, strict=True)
    for experiment in comparison.study.campaign.experiments:
        readings = experiment.taken
        for k, used in enumerate(experiment.used):
            lines.append(
                [
                    experiment.name,
                    str(readings.point[k]),
                    str(readings.group[k]),
                    *(f'{value:.5f}' for value in readings.positions_m[k]),
                    f'{readings.thickness_um[k]:.3f}',
                    *([f'{value:.3f}' for value in next(fitted)] if used else [''] * 3),
                    str(int(used)),
                ]
            )
    write_table(path, lines)
