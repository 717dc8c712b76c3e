"""Films of single passes on a part, and the placement of passes that lays the most even sum."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import PlanError
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.part.points import SurfacePoints
from paint_deposition.part.surface import Surface
from paint_deposition.planning.passes import PassStyle, plan_pass, trajectory_of
from paint_deposition.planning.planned_film import stratified_sample
from paint_deposition.planning.surface_map import SurfaceMap


class LineFilms:
    """Film at points spread evenly over the painted side, for passes along many lines.

    Shadows and effects on the finished film are left out. ``finest_m`` is the scale on which the
    film changes across a pass; lines are laid up to ``beyond_m`` past the part's edges.

    Attributes:
        lines_m: (L,) the lines, and low_m and high_m their ends [m].
        films_um: (L, V) film of each pass at the part's vertices ``rows`` (V,).
    """

    def __init__(
        self,
        surface: Surface,
        surface_map: SurfaceMap,
        model: DepositionModel,
        style: PassStyle,
        finest_m: float,
        beyond_m: float,
        progress: Callable[[float], None] = lambda share: None,
    ) -> None:
        chosen = stratified_sample(surface.vertex_areas_m2[surface_map.painted])
        self.rows = rows = np.flatnonzero(surface_map.painted)[chosen]
        self.surface_map = surface_map
        points = SurfacePoints(surface.vertices_m[rows], surface.normals[rows], down=surface.down)
        low, high = surface_map.extent_m[1]
        self.low_m, self.high_m = low - beyond_m, high + beyond_m
        step = min(finest_m / 5.0, 0.02)
        count = math.ceil((self.high_m - self.low_m) / step) + 1
        self.lines_m = np.linspace(self.low_m, self.high_m, count)
        integrator = FilmIntegrator(points, model)
        # Sub-steps of single passes may be coarser than for a film: 1e-4 of the peak.
        longest = finest_m / 5.0
        # Poses about a sub-step apart; slower ones would be gaps, at which the gun is off.
        rate = max(style.speed_m_per_s / longest, 10.0)
        self.films_um = np.empty((count, len(rows)))
        for k, across in enumerate(self.lines_m):
            line = (plan_pass(surface_map, float(across), style),)
            path, _ = spray_path(trajectory_of(line, rate_hz=rate), max_step_m=longest)
            self.films_um[k] = integrator.raw_of(path)
            progress((k + 1) / count)
        # Cubic splines through the lines' films are linear in them: one matrix for all points.
        self._basis = CubicSpline(self.lines_m, np.eye(count))

    def sigma_n(self, lines_m: np.ndarray) -> np.ndarray:
        """(...) standard deviation over mean of the film of passes along lines (..., n) [m]."""
        weights = self._basis(np.clip(lines_m, self.low_m, self.high_m)).sum(axis=-2)
        film = weights @ self.films_um
        return film.std(axis=-1) / film.mean(axis=-1)


@dataclass(frozen=True)
class Placement:
    """Parallel lines on a part."""

    passes: int  # how many
    index_m: float  # distance between neighbours
    middle_m: float  # coordinate across of their middle
    sigma_n: float  # of their film on the part

    def lines_m(self, direction: str) -> np.ndarray:
        """(n,) coordinates across [m]: level lines from the top down, others from the left."""
        lines = lines_of(self.passes, self.index_m, self.middle_m)
        return lines if direction == 'horizontal' else lines[::-1]


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
    # Loss of evenness accepted for one pass fewer: relative, and in sigma_n itself.
    limit = tolerance or 1.05 * closest.sigma_n + 0.002
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
    high = max(low, min(high, widest))
    index = np.linspace(low, high, 25 if high > low and passes > 1 else 1)
    indices, offsets = (grid.ravel() for grid in np.meshgrid(index, np.linspace(-0.5, 0.5, 25)))
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
