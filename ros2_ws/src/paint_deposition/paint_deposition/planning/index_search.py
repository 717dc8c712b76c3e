"""Evenness over the index: its curve and minima, and how far a tolerance lets it drift."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import PlanError
from paint_deposition.model.eq4_eq5_uniformity import ParallelPasses
from paint_deposition.planning.plane_passes import PassSetup

FEWEST_POINTS, MOST_POINTS = 121, 601
POINTS_PER_SCALE = 12.0
# Where a window ends, and the standoff that is still good, are found to this [m].
PRECISION_M = 1e-7
STANDOFF_PRECISION_M = 1e-4
# Drift is followed as far as these shares of the right value.
LEAST, MOST = 0.4, 1.8
STEPS = 100
# With effects each step costs a pass through the integrator: few, and each with a quarter of the
# sub-steps and samples, which is good to 1e-5 of sigma_n.
STEPS_WITH_EFFECTS = 6
SEARCHED = 0.25


@dataclass(frozen=True)
class Minimum:
    """A local minimum of sigma_n."""

    index_m: float
    sigma_n: float


@dataclass(frozen=True)
class IndexCurve:
    """sigma_n over the index of parallel passes.

    Attributes:
        parallel: the passes.
        index_m: (N,) increasing [m]. sigma_n: (N,).
        minima: refined local minima inside the range, by index.
    """

    parallel: ParallelPasses
    index_m: np.ndarray
    sigma_n: np.ndarray
    minima: tuple[Minimum, ...]

    @staticmethod
    def of(parallel: ParallelPasses, low_m: float, high_m: float) -> 'IndexCurve':
        """Sample a range finely enough to see every minimum, and refine those."""
        finest = min(parallel.first.finest_m, parallel.second.finest_m)
        count = math.ceil((high_m - low_m) / finest * POINTS_PER_SCALE)
        index = np.linspace(low_m, high_m, min(max(count, FEWEST_POINTS), MOST_POINTS))
        sigma = parallel.sigma_n_at(index)
        inside = np.flatnonzero((sigma[1:-1] < sigma[:-2]) & (sigma[1:-1] <= sigma[2:])) + 1
        minima = tuple(_refined(parallel, index[k - 1], index[k + 1]) for k in inside)
        return IndexCurve(parallel, index, sigma, minima)

    @property
    def best_end(self) -> Minimum:
        """The more even end of the range."""
        end = 0 if self.sigma_n[0] <= self.sigma_n[-1] else -1
        return Minimum(float(self.index_m[end]), float(self.sigma_n[end]))

    def windows_m(self, tolerance: float) -> list[tuple[float, float]]:
        """Intervals of the index in the range within which sigma_n keeps to the tolerance."""
        knots = [(float(i), float(s)) for i, s in zip(self.index_m, self.sigma_n, strict=True)]
        knots = sorted(knots + [(m.index_m, m.sigma_n) for m in self.minima])
        ends = [
            _crossing_at(self.parallel.sigma_n, left, right, tolerance)
            for (left, before), (right, after) in pairwise(knots)
            if (before <= tolerance) != (after <= tolerance)
        ]
        if knots[0][1] <= tolerance:
            ends.insert(0, knots[0][0])
        if knots[-1][1] <= tolerance:
            ends.append(knots[-1][0])
        return list(zip(ends[::2], ends[1::2], strict=True))


def _refined(parallel: ParallelPasses, low_m: float, high_m: float) -> Minimum:
    found = minimize_scalar(
        parallel.sigma_n, bounds=(low_m, high_m), method='bounded', options={'xatol': PRECISION_M}
    )
    return Minimum(float(found.x), float(found.fun))


def choose(curve: IndexCurve, tolerance: float | None) -> Minimum:
    """The index to recommend.

    Without a tolerance it is the deepest minimum in the range. With one it lies in the window of
    widest index, for that takes the fewest passes: at the deepest minimum in there.

    Raises:
        PlanError: nothing in the range keeps to the tolerance; names what comes closest.
    """
    minima = curve.minima
    if tolerance is None:
        return min(minima, key=lambda m: m.sigma_n) if minima else curve.best_end
    windows = curve.windows_m(tolerance)
    if not windows:
        closest = min([*minima, curve.best_end], key=lambda m: m.sigma_n)
        raise PlanError(
            f'no index from {curve.index_m[0]:g} to {curve.index_m[-1]:g} m keeps sigma_n within '
            f'{tolerance:g}; the closest is {closest.sigma_n:.4f} at {closest.index_m:.3f} m: '
            'allow that much, or search a smaller index'
        )
    low, high = windows[-1]
    inside = [m for m in minima if low <= m.index_m <= high]
    if inside:
        return min(inside, key=lambda m: m.sigma_n)
    middle = 0.5 * (low + high)
    return Minimum(middle, curve.parallel.sigma_n(middle))


def index_drift_m(
    parallel: ParallelPasses, index_m: float, tolerance: float
) -> tuple[float, float]:
    """Least and greatest index around a good one that keep sigma_n within the tolerance [m]."""
    least, most = (
        _farthest_known(parallel, np.linspace(index_m, share * index_m, STEPS + 1), tolerance)
        for share in (LEAST, MOST)
    )
    return least, most


def _farthest_known(parallel: ParallelPasses, index_m: np.ndarray, tolerance: float) -> float:
    """How far one may go along indexes (N,) [m], the first of them good, within a tolerance."""
    beyond = np.flatnonzero(parallel.sigma_n_at(index_m[1:]) > tolerance)
    if not len(beyond):
        return float(index_m[-1])
    last, first_beyond = index_m[beyond[0] : beyond[0] + 2].tolist()
    return _crossing_at(parallel.sigma_n, last, first_beyond, tolerance)


def standoff_drift_m(
    model: DepositionModel,
    setup: PassSetup,
    speed_m_per_s: float,
    parallel: ParallelPasses,
    index_m: float,
    tolerance: float,
    index_drift: tuple[float, float],
) -> tuple[float, float]:
    """Change of standoff, nearer (negative) and further, that keeps within the tolerance [m].

    The bare projection widens a pass in proportion to its distance from the emission point,
    which is as good as a narrower index; with effects every standoff is computed. ``parallel``
    are the passes at the standoff of the setup.
    """
    here = setup.standoff_m
    if not model.effects:
        distance = here + model.projection.emission_offset_m
        nearer = distance * (index_m / index_drift[1] - 1.0)
        return max(nearer, -here), distance * (index_m / index_drift[0] - 1.0)

    both_ways = not parallel.alike

    @cache  # the search for a crossing asks for its ends again
    def sigma_n(standoff_m: float) -> float:
        there = replace(setup, standoff_m=standoff_m, one_way=setup.one_way or not both_ways)
        return there.parallel_passes(model, speed_m_per_s, SEARCHED).sigma_n(index_m)

    nearest, farthest = (
        _farthest_within(sigma_n, here, share * here, tolerance) for share in (LEAST, MOST)
    )
    return nearest - here, farthest - here


def _crossing_at(
    sigma_n: Callable[[float], float],
    low: float,
    high: float,
    tolerance: float,
    precision_m: float = PRECISION_M,
) -> float:
    """Where a function passes the tolerance between two places on either side of it."""
    return float(brentq(lambda value: sigma_n(value) - tolerance, low, high, xtol=precision_m))


def _farthest_within(
    sigma_n: Callable[[float], float], start: float, limit: float, tolerance: float
) -> float:
    """How far the standoff may go from a good start toward a limit within a tolerance [m]."""
    value = start
    for further in np.linspace(start, limit, STEPS_WITH_EFFECTS + 1)[1:].tolist():
        if sigma_n(further) > tolerance:
            return _crossing_at(sigma_n, value, further, tolerance, STANDOFF_PRECISION_M)
        value = further
    return limit
