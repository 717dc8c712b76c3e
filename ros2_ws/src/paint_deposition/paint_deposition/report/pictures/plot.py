"""Pictures of results on axes of the caller's."""

from typing import Any

from matplotlib.axes import Axes

from paint_deposition.film.film import Film
from paint_deposition.inference.comparison.comparison import Comparison
from paint_deposition.inference.design.reading_choice import ChosenReadings
from paint_deposition.inference.diagnosis.verdict import Diagnosis
from paint_deposition.inference.fitting.calibration import Calibration
from paint_deposition.planning.faces import PartPlan
from paint_deposition.planning.plan import Plan
from paint_deposition.planning.recommendation import Recommendation
from paint_deposition.report.pictures.film import draw_film
from paint_deposition.report.pictures.planning import draw_curve, draw_points
from paint_deposition.report.pictures.readings import draw_agreement


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
    if isinstance(result, Film | Plan | PartPlan):
        above_um = result.statistics.painted_above_um
        draw_film(ax, result.surface, result.film_um, result.path, above_um)
    elif isinstance(result, ChosenReadings):
        draw_points(ax, result)
    elif isinstance(result, Recommendation):
        draw_curve(ax, result)
    elif isinstance(result, Calibration):
        study = result.study
        draw_agreement(ax, study.measured_um, result.fit.predicted_um, study.sigma_um)
    elif isinstance(result, Comparison | Diagnosis):
        of = result.comparisons[-1] if isinstance(result, Diagnosis) else result
        found = of.readings
        draw_agreement(ax, found.measured_um, found.predicted_um, found.sigma_um)
    else:
        raise TypeError(f'{type(result).__name__} is not a result that can be drawn')
    return ax
