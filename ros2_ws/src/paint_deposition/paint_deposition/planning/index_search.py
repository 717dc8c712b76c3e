"""Parallel passes over a plane: their evenness over the index, and how many cover a width."""

import math
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import PlanError
from paint_deposition.film.pass_film import sampled_collapse
from paint_deposition.model.eq4_eq5_uniformity import ParallelPasses
from paint_deposition.planning.requests import IndexRequest

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
class Minimum:
    """A local minimum of sigma_n."""

    index_m: float
    sigma_n: float


@dataclass(frozen=True)
class IndexCurve:
    """sigma_n over the index of parallel passes."""

    parallel: ParallelPasses  # the passes
    index_m: np.ndarray  # (N,) increasing [m]
    sigma_n: np.ndarray  # (N,)
    minima: tuple[Minimum, ...]  # refined local minima inside the range, by index

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
        minima = tuple(Minimum(float(found.x), float(found.fun)) for found in refined)
        return IndexCurve(parallel, index, sigma, minima)

    @property
    def best_end(self) -> Minimum:
        """The more even end of the range."""
        end = 0 if self.sigma_n[0] <= self.sigma_n[-1] else -1
        return Minimum(float(self.index_m[end]), float(self.sigma_n[end]))

    def windows_m(self, tolerance: float) -> list[tuple[float, float]]:
        """Intervals of the index in the range within which sigma_n keeps to the tolerance."""
        knots = [*zip(self.index_m.tolist(), self.sigma_n.tolist(), strict=True)]
        knots = sorted(knots + [(m.index_m, m.sigma_n) for m in self.minima])

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


def choose_index(curve: IndexCurve, tolerance: float | None) -> Minimum:
    """The index to recommend, see ``recommend``.

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
            f'{100 * tolerance:g} %; the closest is {100 * closest.sigma_n:.2f} % at '
            f'{closest.index_m:.3f} m: allow that much (tolerance {1.01 * closest.sigma_n:.2g}), '
            'or search a smaller index'
        )
    low, high = max(windows, key=lambda window: window[1] - window[0])
    ends = [Minimum(end, curve.parallel.sigma_n(end)) for end in (low, high)]
    found = [m for m in minima if low <= m.index_m <= high] or ends
    return min(found, key=lambda m: m.sigma_n)
