"""Where passes lie: the index between them over a plane, and their places on a part."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from operator import itemgetter

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq, minimize, minimize_scalar

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import PaintError
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.film.pass_film import sampled_collapse
from paint_deposition.model.eq4_eq5_uniformity import ParallelPasses
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.part.points import SurfacePoints
from paint_deposition.part.surface import Surface
from paint_deposition.planning.passes import PassStyle, plan_pass, trajectory_of
from paint_deposition.planning.planned_film import stratified_sample
from paint_deposition.planning.requests import IndexRequest
from paint_deposition.planning.sides import SurfaceMap

# Where a window ends is found to this [m].
PRECISION_M = 1e-7
# With effects each pass goes through the integrator: a quarter of the sub-steps and samples is
# good to 1e-5 of sigma_n.
SEARCHED = 0.25


def parallel_passes(
    model: DepositionModel, request: IndexRequest, speed_m_per_s: float, fineness: float = 1.0
) -> ParallelPasses:
    """Endlessly many passes square to a plane at a speed [m/s]; fineness as for their collapse.

    A gun that keeps its orientation lays one profile whichever way it travels, so alternating
    passes are as good as one-way ones. Turned by half a turn for every way back it lays the
    mirrored profile, and an asymmetric pattern makes an uneven pair.
    """
    collapse = partial(
        sampled_collapse, model, speed_m_per_s, fineness,
        standoff_m=request.standoff_m, travel_rad=request.travel_rad,
    )  # fmt: skip
    first = collapse()
    # An effect may depend on the way: forth or back, up or down.
    if request.one_way or not (request.gun_turns or model.effects):
        return ParallelPasses.one_way(first)
    second = collapse(backwards=True, turned=request.gun_turns)
    # Passes that differ by no more than rounding are the same.
    if np.abs(second.film_um - first.film_um).max() <= 1e-9 * first.film_um.max():
        return ParallelPasses.one_way(first)
    return ParallelPasses(first, second)


def passes_to_cover(parallel: ParallelPasses, index_m: float, width_m: float) -> int:
    """Fewest passes, set evenly about the middle, that cover a width to its edges.

    Covered is where the film is at most 5 % below the least of endlessly many passes.
    """
    period = np.linspace(0.0, parallel.period_m(index_m), 65)
    enough = 0.95 * parallel.thickness_um(index_m, period).min()
    across = np.linspace(-0.5 * width_m, 0.5 * width_m, 65)
    reach = max(parallel.first.reach_m, parallel.second.reach_m)
    most = math.ceil((width_m + 2.0 * reach) / index_m) + 2
    for count in range(max(1, math.floor(width_m / index_m)), most):
        film = np.zeros(len(across))
        for number, line_m in enumerate((np.arange(count) - 0.5 * (count - 1)) * index_m):
            collapse = parallel.second if number % 2 else parallel.first
            film += collapse.thickness_um(across - line_m)
        if film.min() >= enough:
            return count
    return most


@dataclass(frozen=True)
class IndexCurve:
    """sigma_n over the index of parallel passes."""

    parallel: ParallelPasses  # the passes
    index_m: np.ndarray  # (N,) increasing [m]
    sigma_n: np.ndarray  # (N,)
    # Refined local minima inside the range, by index [m], each with its sigma_n.
    minima: tuple[tuple[float, float], ...]

    @staticmethod
    def of(parallel: ParallelPasses, low_m: float, high_m: float) -> 'IndexCurve':
        """Sample a range finely enough to see every minimum, and refine those."""
        finest = min(parallel.first.finest_m, parallel.second.finest_m)
        count = math.ceil((high_m - low_m) / finest * 12.0)
        index = np.linspace(low_m, high_m, min(max(count, 121), 601))
        sigma = parallel.sigma_n_at(index)
        inside = np.flatnonzero((sigma[1:-1] < sigma[:-2]) & (sigma[1:-1] <= sigma[2:])) + 1
        refined = [
            minimize_scalar(
                parallel.sigma_n, bounds=(index[k - 1], index[k + 1]), method='bounded',
                options={'xatol': PRECISION_M},
            )
            for k in inside
        ]  # fmt: skip
        minima = tuple((float(found.x), float(found.fun)) for found in refined)
        return IndexCurve(parallel, index, sigma, minima)

    @property
    def best_end(self) -> tuple[float, float]:
        """The more even end of the range [m], and sigma_n there."""
        end = 0 if self.sigma_n[0] <= self.sigma_n[-1] else -1
        return float(self.index_m[end]), float(self.sigma_n[end])

    def windows_m(self, tolerance: float) -> list[tuple[float, float]]:
        """Intervals of the index in the range within which sigma_n keeps to the tolerance."""
        knots = [*zip(self.index_m.tolist(), self.sigma_n.tolist(), strict=True)]
        knots = sorted([*knots, *self.minima])

        def above(index_m: float) -> float:
            return self.parallel.sigma_n(index_m) - tolerance

        ends = [
            float(brentq(above, left, right, xtol=PRECISION_M))
            for (left, before), (right, after) in pairwise(knots)
            if (before <= tolerance) != (after <= tolerance)
        ]
        if knots[0][1] <= tolerance:
            ends.insert(0, knots[0][0])
        if knots[-1][1] <= tolerance:
            ends.append(knots[-1][0])
        return list(zip(ends[::2], ends[1::2], strict=True))


def choose_index(curve: IndexCurve, tolerance: float | None) -> tuple[float, float]:
    """The index to recommend [m], see ``recommend``, and sigma_n there.

    Raises:
        PaintError: nothing in the range keeps to the tolerance; names what comes closest.
    """
    minima = curve.minima
    if tolerance is None:
        return min(minima, key=itemgetter(1)) if minima else curve.best_end
    windows = curve.windows_m(tolerance)
    if not windows:
        index_m, sigma_n = min([*minima, curve.best_end], key=itemgetter(1))
        raise PaintError(
            f'no index from {curve.index_m[0]:g} to {curve.index_m[-1]:g} m keeps sigma_n within '
            f'{100 * tolerance:g} %; the closest is {100 * sigma_n:.2f} % at '
            f'{index_m:.3f} m: allow that much (tolerance {1.01 * sigma_n:.2g}), '
            'or search a smaller index'
        )
    low, high = max(windows, key=lambda window: window[1] - window[0])
    ends = [(end, curve.parallel.sigma_n(end)) for end in (low, high)]
    found = [minimum for minimum in minima if low <= minimum[0] <= high] or ends
    return min(found, key=itemgetter(1))


class LineFilms:
    """Film at points spread evenly over the painted side, for passes along many lines.

    Shadows and effects on the finished film are left out. ``finest_m`` is the scale on which the
    film changes across a pass; lines are laid up to ``beyond_m`` past the part's edges.

    Attributes:
        surface_map: of the painted side.
        low_m, high_m: the outermost lines [m].
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
        rows = np.flatnonzero(surface_map.painted)[chosen]
        self.surface_map = surface_map
        points = SurfacePoints(surface.vertices_m[rows], surface.normals[rows], down=surface.down)
        low, high = surface_map.extent_m[1]
        self.low_m, self.high_m = low - beyond_m, high + beyond_m
        step = min(finest_m / 5.0, 0.02)
        count = math.ceil((self.high_m - self.low_m) / step) + 1
        lines_m = np.linspace(self.low_m, self.high_m, count)
        integrator = FilmIntegrator(points, model)
        # Sub-steps of single passes may be coarser than for a film: 1e-4 of the peak.
        longest = finest_m / 5.0
        # Poses about a sub-step apart; slower ones would be gaps, at which the gun is off.
        rate = max(style.speed_m_per_s / longest, 10.0)
        self._films_um = np.empty((count, len(rows)))
        for k, across in enumerate(lines_m):
            line = (plan_pass(surface_map, float(across), style),)
            path, _ = spray_path(trajectory_of(line, rate_hz=rate), max_step_m=longest)
            self._films_um[k] = integrator.raw_of(path)
            progress((k + 1) / count)
        # Cubic splines through the lines' films are linear in them: one matrix for all points.
        self._basis = CubicSpline(lines_m, np.eye(count))

    def sigma_n(self, lines_m: np.ndarray) -> np.ndarray:
        """(...) standard deviation over mean of the film of passes along lines (..., n) [m]."""
        weights = self._basis(np.clip(lines_m, self.low_m, self.high_m)).sum(axis=-2)
        film = weights @ self._films_um
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
    films: LineFilms, index_range_m: tuple[float, float], tolerance: float | None = None
) -> Placement:
    """The placement with the fewest passes that is nearly the most even, or within tolerance.

    Equal ends of the range fix the index.

    Raises:
        PaintError: no placement is within the tolerance; names the closest.
    """
    height = float(np.ptp(films.surface_map.extent_m[1]))
    fewest = max(1, int(height / index_range_m[1]))
    most = max(fewest, int(np.ceil(height / index_range_m[0])) + 1)
    best = [
        placement
        for passes in range(fewest, most + 1)
        if (placement := best_placement(films, index_range_m, passes)) is not None
    ]
    closest = min(best, key=lambda placement: placement.sigma_n)
    # Loss of evenness accepted for one pass fewer: relative, and in sigma_n itself.
    limit = tolerance or 1.05 * closest.sigma_n + 0.002
    good = [placement for placement in best if placement.sigma_n <= limit]
    if not good:
        raise PaintError(
            f'no passes at an index of {index_range_m[0]:.3f} to {index_range_m[1]:.3f} m keep '
            f'sigma_n on this part within {100 * limit:g} %; the closest is '
            f'{100 * closest.sigma_n:.2f} % with {closest.passes} at {closest.index_m:.3f} m: '
            'allow that much, or a smaller index'
        )
    return good[0]


def best_placement(
    films: LineFilms, index_range_m: tuple[float, float], passes: int
) -> Placement | None:
    """The most even placing of so many passes; None where it has no room."""
    middle = 0.5 * float(films.surface_map.extent_m[1].sum())
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
    middle += float(found.x[1]) * there
    sigma_n = float(films.sigma_n(lines_of(passes, there, middle)))
    return Placement(passes, there, middle, sigma_n)
