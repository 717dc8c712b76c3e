"""Film against target: each part in figures, and each measured point with its verdict."""

from typing import Any

import numpy as np

from paint_deposition.film.statistics import FilmStatistics, film_statistics
from paint_deposition.report.data import ReportData
from paint_deposition.report.style import TWO_SIDED_95
from paint_deposition.report.words import joined, minus

LOW, IN, HIGH = 'low', 'in', 'high'


def film_rows(data: ReportData) -> list[dict[str, Any]]:
    """For each part its readings, and its film as the best model predicts it."""
    rows = []
    for k, experiment in enumerate(data.experiments):
        measured = data.study.measured_um[data.rows_of(k)]
        painted = data.painted[k][-1]
        rows.append(
            {
                'name': experiment.name,
                'measured': measured,
                'bands': band_shares(data, measured),
                'film': film_statistics(
                    painted.film_um, experiment.surface.vertex_areas_m2, painted.emitted_cm3,
                    target_um=data.target_um or 0.0, target_tolerance_um=data.tolerance_um or 0.0,
                ),
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


def film_words(data: ReportData) -> str:
    """The film of all parts in a few sentences."""
    target = 'No target is known: give target_um and tolerance_um in the campaign.'
    if data.target_um is not None:
        target = f'Wanted are {data.target_um:g} ± {data.tolerance_um:g} µm.'
    return ' '.join([*(_part_words(row) for row in film_rows(data)), target])


def _part_words(row: dict[str, Any]) -> str:
    measured, film = row['measured'], row['film']
    text = (
        f'{row["name"]}: {measured.mean():.1f} µm measured on average, {measured.min():.1f} to '
        f'{measured.max():.1f} µm'
    )
    if not row['bands']:
        return f'{text}.'
    return f'{text}; {_shares(row["bands"])} of the points, {_area_shares(film)} of the area.'


def _shares(bands: dict[str, float]) -> str:
    return joined([f'{100 * share:.0f} % {name}' for name, share in bands.items()])


def _area_shares(film: FilmStatistics) -> str:
    return _shares({LOW: film.below_target, IN: film.within_target, HIGH: film.above_target})


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


def share_words(share: float) -> str:
    """A share of an area or of points as a percentage."""
    return minus(f'{100 * share:.0f} %')
