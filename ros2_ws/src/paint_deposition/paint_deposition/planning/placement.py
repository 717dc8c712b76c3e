"""Placement of passes on a part: number, index and offset, chosen by their summed film."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from paint_deposition.errors import PlanError
from paint_deposition.planning.films import LineFilms

INDICES, OFFSETS = 25, 25
# Loss of evenness accepted for one pass fewer: relative, and in sigma_n itself.
SLACK, LEAST_SLACK = 1.05, 0.002


@dataclass(frozen=True)
class Placement:
    """Parallel lines on a part."""

    passes: int  # how many
    index_m: float  # distance between neighbours
    middle_m: float  # coordinate across of their middle
    sigma_n: float  # of their film on the part

    @property
    def lines_m(self) -> np.ndarray:
        """(n,) coordinates across, increasing [m]."""
        return lines_of(self.passes, self.index_m, self.middle_m)


def lines_of(passes: int, index_m: float | np.ndarray, middle_m: float | np.ndarray) -> np.ndarray:
    """Lines (..., n) of evenly spaced passes from their indices and middles (...) [m]."""
    steps = np.arange(passes) - 0.5 * (passes - 1)
    return np.asarray(middle_m)[..., np.newaxis] + np.asarray(index_m)[..., np.newaxis] * steps


def place_passes(
    films: LineFilms,
    extent_m: tuple[float, float],
    index_range_m: tuple[float, float],
    tolerance: float | None = None,
) -> Placement:
    """The placement with the fewest passes that is nearly the most even, or within tolerance.

    ``extent_m``: ends of the part across the passes; ``index_range_m``: equal ends fix the index.

    Raises:
        PlanError: no placement is within the tolerance; names the closest.
    """
    height = extent_m[1] - extent_m[0]
    fewest = max(1, int(height / index_range_m[1]))
    most = max(fewest, int(np.ceil(height / index_range_m[0])) + 1)
    best = [
        placement
        for passes in range(fewest, most + 1)
        if (placement := best_placement(films, extent_m, index_range_m, passes)) is not None
    ]
    closest = min(best, key=lambda placement: placement.sigma_n)
    limit = tolerance or SLACK * closest.sigma_n + LEAST_SLACK
    good = [placement for placement in best if placement.sigma_n <= limit]
    if not good:
        raise PlanError(
            f'no passes at an index of {index_range_m[0]:.3f} to {index_range_m[1]:.3f} m keep '
            f'sigma_n on this part within {100 * limit:g} %; the closest is '
            f'{100 * closest.sigma_n:.2f} % with {closest.passes} at {closest.index_m:.3f} m: '
            'allow that much, or a smaller index'
        )
    return good[0]


def placement_at(films: LineFilms, passes: int, index_m: float, middle_m: float) -> Placement:
    """Lines with sigma_n of their film."""
    sigma_n = float(films.sigma_n(lines_of(passes, index_m, middle_m)))
    return Placement(passes, index_m, middle_m, sigma_n)


def best_placement(
    films: LineFilms,
    extent_m: tuple[float, float],
    index_range_m: tuple[float, float],
    passes: int,
) -> Placement | None:
    """The most even placing of so many passes; None where it has no room."""
    middle = 0.5 * (extent_m[0] + extent_m[1])
    low, high = index_range_m
    # Lines further out than the films that are kept are not considered.
    widest = (films.high_m - films.low_m) / max(passes - 1, 1)
    high = min(high, widest)
    index = np.linspace(low, high, INDICES if high > low and passes > 1 else 1)
    offset = np.linspace(-0.5, 0.5, OFFSETS)
    indices, offsets = (grid.ravel() for grid in np.meshgrid(index, offset))
    lines = lines_of(passes, indices, middle + offsets * indices)
    inside = (lines.min(axis=1) >= films.low_m) & (lines.max(axis=1) <= films.high_m)
    if not inside.any():
        return None
    sigma = np.where(inside, films.sigma_n(lines), np.inf)
    # On a symmetric part two offsets are as good: the first, whatever the last digit says.
    start = int(np.argmin(np.round(sigma, 6)))

    def objective(x: np.ndarray) -> float:
        there = float(np.clip(x[0], low, high))
        spread = lines_of(passes, there, middle + x[1] * there)
        if spread.min() < films.low_m or spread.max() > films.high_m:
            return np.inf
        return float(films.sigma_n(spread)) + abs(x[0] - there)

    first = np.array([indices[start], offsets[start]])
    aside = np.array([[0.0, 0.0], [min(0.01, high - first[0]) or -0.01, 0.0], [0.0, 0.02]])
    found = minimize(
        objective,
        first,
        method='Nelder-Mead',
        options={'xatol': 1e-4, 'fatol': 1e-5, 'maxfev': 200, 'initial_simplex': first + aside},
    )
    there = float(np.clip(found.x[0], low, high))
    return placement_at(films, passes, there, middle + float(found.x[1]) * there)
