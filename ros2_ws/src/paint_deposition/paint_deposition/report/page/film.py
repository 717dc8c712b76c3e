"""Film against target: each part in figures, and each measured point with its verdict."""

from typing import Any

import numpy as np

from paint_deposition.film.statistics import film_statistics
from paint_deposition.report.data import ReportData
from paint_deposition.report.style import TWO_SIDED_95

LOW, IN, HIGH = 'low', 'in', 'high'


def film_rows(data: ReportData) -> list[dict[str, Any]]:
    """For each part its readings, and its film as the best model predicts it."""
    rows = []
    for k, experiment in enumerate(data.experiments):
        measured = data.study.measured_um[data.rows_of(k)]
        painted = data.painted[k][-1]
        film = film_statistics(
            painted.film_um, experiment.surface.vertex_areas_m2, painted.emitted_cm3,
            target_um=data.target_um or 0.0, target_tolerance_um=data.tolerance_um or 0.0,
        )  # fmt: skip
        rows.append(
            {
                'name': experiment.name,
                'measured': measured,
                'bands': band_shares(data, measured),
                'areas': {
                    LOW: film.below_target, IN: film.within_target, HIGH: film.above_target
                },
                'film': film,
            }
        )  # fmt: skip
    return rows


def band_shares(data: ReportData, film_um: np.ndarray) -> dict[str, float]:
    """Shares of films (N,) that are low, in and high; empty without a target."""
    if data.target_um is None:
        return {}
    bands = [band_of(data, value) for value in film_um]
    return {name: bands.count(name) / len(bands) for name in (LOW, IN, HIGH)}


def band_of(data: ReportData, film_um: float) -> str:
    """Where a film is beside the target band; '' without a target."""
    if data.target_um is None or data.tolerance_um is None:
        return ''
    off = film_um - data.target_um
    return IN if abs(off) <= data.tolerance_um else LOW if off < 0.0 else HIGH


def shares_in_words(shares: dict[str, float]) -> str:
    """'20 % low, 75 % in, 5 % high'."""
    return ', '.join(f'{100 * share:.0f} % {name}' for name, share in shares.items())


def point_rows(data: ReportData) -> list[dict[str, Any]]:
    """Each measured point: where, measured, predicted, deviation, and whether that is right.

    The model is right where the deviation is within what gauge and texture scatter by in 95 % of
    readings; the film is right in the target band.
    """
    found = data.comparisons[-1].points
    rows: list[dict[str, Any]] = []
    for k, experiment in enumerate(data.experiments):
        first = data.rows_of(k).start
        labels, groups = experiment.readings.point[experiment.means.first], experiment.groups
        for p, position in enumerate(experiment.measured_points.positions_m):
            row = first + p
            residual, scatter = found.residual_um[row], TWO_SIDED_95 * found.sigma_um[row]
            rows.append(
                {
                    'part': experiment.name, 'point': str(labels[p]), 'group': str(groups[p]),
                    'x_mm': 1e3 * position[0], 'y_mm': 1e3 * position[1],
                    'z_mm': 1e3 * position[2],
                    'measured_um': found.measured_um[row], 'predicted_um': found.predicted_um[row],
                    'deviation_um': residual, 'scatter_um': scatter,
                    'model': 'OK' if abs(residual) <= scatter else 'off',
                    'film': band_of(data, found.measured_um[row]),
                }
            )  # fmt: skip
    return rows


def points_csv(rows: list[dict[str, Any]]) -> str:
    """The same as a table for a spreadsheet."""
    lines = [','.join(rows[0])]
    lines += [','.join(_cell(value) for value in row.values()) for row in rows]
    return '\n'.join(lines) + '\n'


def _cell(value: Any) -> str:
    if isinstance(value, str):
        return f'"{value.replace(chr(34), 2 * chr(34))}"' if set(value) & set(',"\n') else value
    return f'{value:.3f}'
