"""Pictures of results on axes of the caller's."""

from __future__ import annotations

from functools import singledispatch
from typing import Any

from matplotlib.axes import Axes

from paint_deposition.film.film import Film
from paint_deposition.inference.comparison.comparison import Comparison
from paint_deposition.inference.diagnosis.reading_choice import ChosenReadings
from paint_deposition.inference.diagnosis.verdict import Diagnosis
from paint_deposition.inference.fitting.calibration import Calibration
from paint_deposition.planning.part_plan import PartPlan
from paint_deposition.planning.plan import Plan
from paint_deposition.planning.recommendation import Recommendation
from paint_deposition.report.pictures.film import draw_film
from paint_deposition.report.pictures.inference import draw_agreement, draw_points
from paint_deposition.report.pictures.planning import draw_curve


def plot(result: Any, ax: Axes | None = None) -> Axes:
    """Draw a result: a film, a plan or points on their part, a curve, or measured over predicted.

    Args:
        result: what a verb of this package returned.
        ax: where to draw; default: matplotlib's present axes.

    Returns:
        The axes, for titles and more.
    """
    if ax is None:
        from matplotlib import pyplot

        ax = pyplot.gca()
    _draw(result, ax)
    return ax


@singledispatch
def _draw(result: Any, ax: Axes) -> None:
    raise TypeError(f'{type(result).__name__} is not a result that can be drawn')


@_draw.register(Film)
@_draw.register(Plan)
@_draw.register(PartPlan)
def _(result: Film | Plan | PartPlan, ax: Axes) -> None:
    draw_film(ax, result.surface, result.film_um, result.path, result.statistics.painted_above_um)


@_draw.register
def _(result: ChosenReadings, ax: Axes) -> None:
    draw_points(ax, result)


@_draw.register
def _(result: Recommendation, ax: Axes) -> None:
    draw_curve(ax, result)


@_draw.register
def _(result: Comparison, ax: Axes) -> None:
    readings = result.readings
    draw_agreement(ax, readings.measured_um, readings.predicted_um, readings.sigma_um)


@_draw.register
def _(result: Diagnosis, ax: Axes) -> None:
    _draw(result.comparisons[-1], ax)


@_draw.register
def _(result: Calibration, ax: Axes) -> None:
    study = result.study
    draw_agreement(ax, study.measured_um, result.fit.predicted_um, study.sigma_um)
