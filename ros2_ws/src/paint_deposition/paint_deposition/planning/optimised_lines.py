"""Lines for passes that need not be evenly apart: few, where their paint lands, evenly.

Candidates are lines close together, at some standoffs and leans of the gun. What each node of each
of them lays is computed when it is asked for; the best densities of paint along some of the lines
are a quadratic program. Lines are moved, and their guns leaned and drawn back, one by one; the
number of lines is the one whose film and paint cost least.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property

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
# Standoffs and leans that are tried, where they are free.
STANDOFFS, LEANS = 5, 5
# Lines are moved by so many candidates at first, then by half of it, down to one.
FIRST_MOVE = 4

# A candidate: the numbers of its line, standoff and lean.
Candidate = tuple[int, int, int]


@dataclass(frozen=True)
class Lines:
    """Passes on a part.

    Attributes:
        lines_m: (n,) coordinates across, increasing [m].
        styles: (n,) how each is run, at its mean speed.
        cost: mean square of film / target - 1, and what paint and time are worth.
    """

    lines_m: np.ndarray
    styles: tuple[PassStyle, ...]
    cost: float


@dataclass(frozen=True)
class _Laid:
    """What the nodes of a candidate lay.

    Attributes:
        shares: (n, V) film / target for a density of 1 s/m at each node.
        lengths_m: (n,) travel that each stands for. open_ends: (n,) whether the gun may be closed.
    """

    shares: np.ndarray
    lengths_m: np.ndarray
    open_ends: np.ndarray


@dataclass(frozen=True)
class LineSearch:
    """Chooses lines by the film that the best speeds along them would lay.

    Attributes:
        films: of single passes, with the part's smoothed surface.
        at_points: films at points of the part.
        style: how passes are run. target_um: film wanted.
        limits, wish: of robot and film; the weights are per paint and time of the next two.
        wanted_s, given_s: paint wanted on the part as time sprayed, and a usual cycle time [s].
        standoffs_m: (S,) to choose from. leans_rad: (L,) to choose from.
    """

    films: LineFilms
    at_points: FilmAtPoints
    style: PassStyle
    target_um: float
    limits: Limits
    wish: Wish
    wanted_s: float
    given_s: float
    standoffs_m: np.ndarray
    leans_rad: np.ndarray
    _laid: dict[Candidate, _Laid] = field(default_factory=dict)
    _known: dict[tuple[Candidate, ...], Lines] = field(default_factory=dict)

    @cached_property
    def _width_m(self) -> float:
        planar = self.at_points.model.planar
        return min(planar.sigma1_m, planar.sigma2_m)

    @cached_property
    def _spacing_m(self) -> float:
        """Of nodes along a pass."""
        return min(self._width_m / NODES_PER_SIGMA, COARSEST_M)

    @cached_property
    def lines_m(self) -> np.ndarray:
        """(K,) coordinates across of the candidates [m]."""
        low, high = self.films.low_m, self.films.high_m
        step = min(self._width_m / LINES_PER_SIGMA, COARSEST_M)
        return np.linspace(low, high, int(np.ceil((high - low) / step)) + 1)

    def best(self, passes: int, low_m: float, high_m: float) -> Lines:
        """The best lines for so many passes, from even ones between two ends of the part [m]."""
        even = low_m + (np.arange(passes) + 0.5) / passes * (high_m - low_m)
        lines = [int(np.abs(self.lines_m - line).argmin()) for line in even]
        if len(set(lines)) < passes:
            return Lines(even, (self.style,) * passes, np.inf)
        standoff = int(np.abs(self.standoffs_m - self.style.standoff_m).argmin())
        upright = int(np.abs(self.leans_rad).argmin())
        now = tuple((line, standoff, upright) for line in lines)
        step = FIRST_MOVE
        while step:
            better = min(self._neighbours(now, step), key=lambda some: self._judged(some).cost)
            if self._judged(better).cost < self._judged(now).cost:
                now = better
            else:
                step //= 2
        return self._judged(now)

    def _neighbours(self, now: tuple[Candidate, ...], step: int) -> list[tuple[Candidate, ...]]:
        """All passes together, each of them, and all apart, changed both ways in one respect."""
        ways = [np.ones(len(now), int), *np.eye(len(now), dtype=int)]
        if len(now) > 1:
            ways.append(np.rint(np.linspace(-1.0, 1.0, len(now))).astype(int))
        counts = np.array([len(self.lines_m), len(self.standoffs_m), len(self.leans_rad)])
        found = []
        for respect, much in enumerate((step, 1, 1)):
            for way in ways:
                for sign in (1, -1):
                    some = np.array(now)
                    some[:, respect] += sign * much * way
                    apart = np.all(np.diff(some[:, 0]) > 0)
                    if apart and (some >= 0).all() and (some < counts).all():
                        found.append(tuple(map(tuple, some.tolist())))
        return found or [now]

    def _judged(self, some: tuple[Candidate, ...]) -> Lines:
        if some not in self._known:
            self._known[some] = self._solved(some)
        return self._known[some]

    def _style(self, candidate: Candidate) -> PassStyle:
        _, standoff, lean = candidate
        return replace(
            self.style,
            standoff_m=float(self.standoffs_m[standoff]),
            lean_rad=float(self.leans_rad[lean]),
        )

    def _laid_by(self, candidate: Candidate) -> _Laid:
        if candidate not in self._laid:
            style, line = self._style(candidate), float(self.lines_m[candidate[0]])
            rate = max(style.speed_m_per_s / self.at_points.step_m, SLOWEST_RATE_HZ)
            planned = plan_pass(self.films.surface_map, line, style)
            programme = Programme.of(trajectory_of((planned,), style, rate_hz=rate))
            nodes = Nodes.of(programme.openings, self._spacing_m)
            even = np.full(len(nodes), 1.0 / style.speed_m_per_s)
            laid = self.at_points.of_nodes(programme, nodes, even).per_density_um
            open_ends = may_be_closed(nodes, programme.openings, self.limits)
            self._laid[candidate] = _Laid(laid / self.target_um, nodes.weights_m, open_ends)
        return self._laid[candidate]

    def _solved(self, some: tuple[Candidate, ...]) -> Lines:
        laid = [self._laid_by(candidate) for candidate in some]
        films = np.concatenate([one.shares for one in laid])
        lengths = np.concatenate([one.lengths_m for one in laid])
        open_ends = np.concatenate([one.open_ends for one in laid])
        number = np.repeat(np.arange(len(some)), [len(one.lengths_m) for one in laid])
        price = lengths * (
            self.wish.paint_weight / self.wanted_s + self.wish.time_weight / self.given_s
        )
        density = self._densities(films, number, open_ends, price)
        error = density @ films - 1.0
        seconds = np.bincount(number, lengths * density)
        metres = np.bincount(number, lengths * (density > 0.5 / self.limits.speed_max_m_per_s))
        cost = float(np.mean(error**2) + price @ density)
        # Between passes the robot turns and comes back to speed.
        turn_s = 2.0 * self.style.speed_m_per_s / self.style.acceleration_m_per_s2
        cost += self.wish.time_weight * len(some) * turn_s / self.given_s
        speeds = np.maximum(metres, 1e-3) / np.maximum(seconds, 1e-3)
        styles = tuple(
            replace(self._style(candidate), speed_m_per_s=float(speed))
            for candidate, speed in zip(some, speeds, strict=True)
        )
        return Lines(self.lines_m[[line for line, _, _ in some]], styles, cost)

    def _densities(
        self, films: np.ndarray, number: np.ndarray, open_ends: np.ndarray, price: np.ndarray
    ) -> np.ndarray:
        """(n,) best densities [s/m] that keep to the bounds of the speed alone.

        Args:
            films: (n, V) film / target for a density of 1 s/m at each node.
            number, open_ends: (n,) its line, and whether the gun may be closed there.
            price: (n,) what a density costs, beside evenness and smoothness.
        """
        count, usual = len(films), self._spacing_m / SLOPE_M / self.style.speed_m_per_s
        matrix = 2.0 / films.shape[1] * films @ films.T
        linear = price - 2.0 / films.shape[1] * films.sum(axis=1)
        pairs = np.flatnonzero(number[1:] == number[:-1])
        change = np.zeros((len(pairs), count))
        change[np.arange(len(pairs)), pairs] = -1.0 / usual
        change[np.arange(len(pairs)), pairs + 1] = 1.0 / usual
        matrix += 2.0 * self.wish.smoothness / len(pairs) * change.T @ change
        least = np.where(open_ends, 0.0, 1.0 / self.limits.speed_max_m_per_s)
        # A search among many sets of lines: quick rather than exact.
        answer = minimize(
            lambda y: (0.5 * y @ (found := matrix @ y) + linear @ y, found + linear),
            np.maximum(least, 2.0 * usual), jac=True, method='L-BFGS-B',
            bounds=Bounds(least, 1.0 / self.limits.speed_min_m_per_s), options={'ftol': 1e-8},
        )  # fmt: skip
        return answer.x
