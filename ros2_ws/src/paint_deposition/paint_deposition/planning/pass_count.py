"""How many passes a width takes, and how long they take."""

import math

import numpy as np

from paint_deposition.model.collapse import Collapse
from paint_deposition.model.uniformity import ParallelPasses, Variation, variation

# Share by which the film at the part's edge may fall below the least film inside.
EDGE_LOSS = 0.05


def passes_to_cover(raster: ParallelPasses, index_m: float, width_m: float) -> int:
    """Fewest passes, set evenly about the middle, that cover a width to its edges.

    Covered is where the film is at most EDGE_LOSS below the least film of the endless raster.
    """
    period = np.linspace(0.0, raster.period_m(index_m), 65)
    enough = (1.0 - EDGE_LOSS) * raster.thickness_um(index_m, period).min()
    across = np.linspace(-0.5 * width_m, 0.5 * width_m, 65)
    reach = max(raster.first.reach_m, raster.second.reach_m)
    most = math.ceil((width_m + 2.0 * reach) / index_m) + 2
    for count in range(max(1, math.floor(width_m / index_m)), most):
        film = np.zeros(len(across))
        for collapse, line_m in _laid_evenly(raster, index_m, count):
            film += collapse.thickness_um(across - line_m)
        if film.min() >= enough:
            return count
    return most


def variation_over_width(
    raster: ParallelPasses, index_m: float, passes: int, width_m: float
) -> Variation:
    """Mean and sigma_n over the whole width, its edges included, of so many passes."""
    return variation(_laid_evenly(raster, index_m, passes), -0.5 * width_m, 0.5 * width_m)


def _laid_evenly(
    raster: ParallelPasses, index_m: float, passes: int
) -> list[tuple[Collapse, float]]:
    """Collapse and line of each pass, about the middle."""
    lines = (np.arange(passes) - 0.5 * (passes - 1)) * index_m
    return [
        (raster.second if number % 2 else raster.first, float(line))
        for number, line in enumerate(lines)
    ]


def cycle_time_s(
    passes: int, length_m: float, index_m: float, speed_m_per_s: float, one_way: bool
) -> float:
    """Time from the first opening of the gun to its last closing, at an even speed [s]."""
    between = math.hypot(length_m, index_m) if one_way else index_m
    return (passes * length_m + (passes - 1) * between) / speed_m_per_s
