"""Lines for passes that need not be evenly apart: few, where their paint lands, evenly.

Candidates are lines close together. What each node of each of them lays is known; the best
densities of paint along some of the lines are a quadratic program. Lines are moved one by one,
and the number is the one whose film and paint cost least.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import Bounds, minimize

from paint_deposition.planning.improvement.dwell_films import FilmAtPoints
from paint_deposition.planning.improvement.limits import Limits, Wish
from paint_deposition.planning.improvement.nodes import Nodes
from paint_deposition.planning.improvement.programme import Programme
from paint_deposition.planning.improvement.quadratic_program import SLOPE_M
from paint_deposition.planning.improvement.triggers import may_be_closed
from paint_deposition.planning.pass_films import SLOWEST_RATE_HZ, LineFilms
from paint_deposition.planning.pass_motion import trajectory_of
from paint_deposition.planning.passes import PassStyle, plan_pass

# Candidates per width of the pattern across, and nodes per width along.
LINES_PER_SIGMA, NODES_PER_SIGMA = 3.0, 1.5
COARSEST_M = 0.06
POINTS = 500
# Lines are moved by so many candidates at first, then by half of it, down to one.
FIRST_MOVE = 4


@dataclass(frozen=True)
class Lines:
    """Passes on a part.

    Attributes:
        lines_m: (n,) coordinates across, increasing [m].
        speeds_m_per_s: (n,) mean speed along each.
        cost: mean square of film / target - 1, and what paint and time are worth.
    """

    lines_m: np.ndarray
    speeds_m_per_s: np.ndarray
    cost: float


class LineSearch:
    """Chooses lines by the film that the best speeds along them would lay.

    Args:
        films: of single passes, with the part's smoothed surface.
        at_points: films at points of the part.
        style: how passes are run. target_um: film wanted.
        limits, wish: of robot and film; the weights are per paint and time of the next two.
        wanted_s, given_s: paint wanted on the part as time sprayed, and a usual cycle time [s].
        progress: called with the share done.
    """

    def __init__(
        self,
        films: LineFilms,
        at_points: FilmAtPoints,
        style: PassStyle,
        target_um: float,
        limits: Limits,
        wish: Wish,
        wanted_s: float,
        given_s: float,
        progress: Callable[[float], None],
    ) -> None:
        self._wish, self._limits = wish, limits
        self._wanted_s, self._given_s = wanted_s, given_s
        width = min(at_points.model.planar.sigma1_m, at_points.model.planar.sigma2_m)
        step = min(width / LINES_PER_SIGMA, COARSEST_M)
        count = int(np.ceil((films.high_m - films.low_m) / step)) + 1
        self.lines_m = np.linspace(films.low_m, films.high_m, count)
        self._films, self._lengths, self._open = [], [], []
        rate = max(style.speed_m_per_s / at_points.step_m, SLOWEST_RATE_HZ)
        for number, line in enumerate(self.lines_m):
            progress(number / count)
            planned = plan_pass(films.surface_map, float(line), style)
            programme = Programme.of(trajectory_of((planned,), style, rate_hz=rate))
            nodes = Nodes.of(programme.openings, min(width / NODES_PER_SIGMA, COARSEST_M))
            even = np.full(len(nodes), 1.0 / style.speed_m_per_s)
            laid = at_points.of_nodes(programme, nodes, even).per_density_um
            self._films.append(laid / target_um)
            self._lengths.append(nodes.weights_m)
            self._open.append(may_be_closed(nodes, programme.openings, limits))
        spacing = min(width / NODES_PER_SIGMA, COARSEST_M)
        self._usual = spacing / SLOPE_M / style.speed_m_per_s
        # Between passes the robot turns and comes back to speed.
        self._turn_s = 2.0 * style.speed_m_per_s / style.acceleration_m_per_s2
        self._known: dict[tuple[int, ...], Lines] = {}

    def best(self, passes: int, low_m: float, high_m: float) -> Lines:
        """The best lines for so many passes, from even ones between two ends of the part [m]."""
        even = low_m + (np.arange(passes) + 0.5) / passes * (high_m - low_m)
        now = tuple(int(np.abs(self.lines_m - line).argmin()) for line in even)
        if len(set(now)) < passes:
            return Lines(even, np.ones(passes), np.inf)
        step = FIRST_MOVE
        while step:
            better = min(self._neighbours(now, step), key=lambda some: self._judged(some).cost)
            if self._judged(better).cost < self._judged(now).cost:
                now = better
            else:
                step //= 2
        return self._judged(now)

    def _neighbours(self, now: tuple[int, ...], step: int) -> list[tuple[int, ...]]:
        """All lines together, each of them, and all apart, moved both ways."""
        ways = [np.ones(len(now), int), *np.eye(len(now), dtype=int)]
        if len(now) > 1:
            ways.append(np.rint(np.linspace(-1.0, 1.0, len(now))).astype(int))
        moved = [np.array(now) + sign * step * way for way in ways for sign in (1, -1)]
        inside = [
            tuple(some.tolist())
            for some in moved
            if some.min() >= 0 and some.max() < len(self.lines_m) and np.all(np.diff(some) > 0)
        ]
        return inside or [now]

    def _judged(self, some: tuple[int, ...]) -> Lines:
        if some not in self._known:
            self._known[some] = self._solved(some)
        return self._known[some]

    def _solved(self, some: tuple[int, ...]) -> Lines:
        films = np.concatenate([self._films[k] for k in some])
        lengths = np.concatenate([self._lengths[k] for k in some])
        open_ends = np.concatenate([self._open[k] for k in some])
        number = np.repeat(np.arange(len(some)), [len(self._lengths[k]) for k in some])
        price = lengths * (
            self._wish.paint_weight / self._wanted_s + self._wish.time_weight / self._given_s
        )
        density = self._densities(films, number, open_ends, price)
        error = density @ films - 1.0
        seconds = np.bincount(number, lengths * density)
        metres = np.bincount(number, lengths * (density > 0.5 / self._limits.speed_max_m_per_s))
        cost = float(np.mean(error**2) + price @ density)
        cost += self._wish.time_weight * len(some) * self._turn_s / self._given_s
        speeds = np.maximum(metres, 1e-3) / np.maximum(seconds, 1e-3)
        return Lines(self.lines_m[list(some)], speeds, cost)

    def _densities(
        self, films: np.ndarray, number: np.ndarray, open_ends: np.ndarray, price: np.ndarray
    ) -> np.ndarray:
        """(n,) best densities [s/m] that keep to the bounds of the speed alone.

        Args:
            films: (n, V) film / target for a density of 1 s/m at each node.
            number, open_ends: (n,) its line, and whether the gun may be closed there.
            price: (n,) what a density costs, beside evenness and smoothness.
        """
        count = len(films)
        matrix = 2.0 / films.shape[1] * films @ films.T
        linear = price - 2.0 / films.shape[1] * films.sum(axis=1)
        pairs = np.flatnonzero(number[1:] == number[:-1])
        change = np.zeros((len(pairs), count))
        change[np.arange(len(pairs)), pairs] = -1.0 / self._usual
        change[np.arange(len(pairs)), pairs + 1] = 1.0 / self._usual
        matrix += 2.0 * self._wish.smoothness / len(pairs) * change.T @ change
        least = np.where(open_ends, 0.0, 1.0 / self._limits.speed_max_m_per_s)
        # A search among many sets of lines: quick rather than exact.
        answer = minimize(
            lambda y: (0.5 * y @ (found := matrix @ y) + linear @ y, found + linear),
            np.maximum(least, 2.0 * self._usual), jac=True, method='L-BFGS-B',
            bounds=Bounds(least, 1.0 / self._limits.speed_min_m_per_s), options={'ftol': 1e-8},
        )  # fmt: skip
        return answer.x
