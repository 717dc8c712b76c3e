"""A plan whose passes are as few as are worth their paint, with speeds of their own along them.

Candidates are lines close together, at some standoffs and leans of the gun. What each node of each
of them lays is computed when it is needed; the best densities of paint along some of the lines are
a quadratic program. Lines are moved, and their guns leaned and drawn back, one by one.

Many sets of lines cost nearly the same. So that the last digits of a processor do not choose among
them, what costs less by no more than a share counts as equal, and of equals the first in a fixed
order is taken: fewer passes before more, and a set that is found before its neighbours.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.optimize import Bounds, minimize

from paint_deposition.errors import PlanError
from paint_deposition.planning.films import (
    FilmAtPoints,
    LineFilms,
    evenness,
    line_motion,
    simulated,
)
from paint_deposition.planning.improvement.nodes import Nodes
from paint_deposition.planning.improvement.programme import Programme, moves_of
from paint_deposition.planning.improvement.quadratic_program import SLOPE_M
from paint_deposition.planning.improvement.retiming import may_be_closed, retime_for_evenness
from paint_deposition.planning.passes import PassStyle, plan_passes, trajectory_of
from paint_deposition.planning.placing import Placing
from paint_deposition.planning.plan import Plan, planned_statistics
from paint_deposition.planning.requests import ImproveRequest

# A pass more must save this share of the cost; a change of the lines this one.
WORTH_A_PASS, WORTH_A_CHANGE = 0.05, 1e-3
# Candidates per width of the pattern across, and nodes per width along.
LINES_PER_SIGMA, NODES_PER_SIGMA = 3.0, 1.5
COARSEST_M = 0.06
POINTS = 500
# Standoffs and leans that are tried, where they are free.
STANDOFFS, LEANS = 5, 5
# Standoffs closer together are the same.
SAME_STANDOFF_M = 1e-4
# Lines are moved by so many candidates at first, then by half of it, down to one.
FIRST_MOVE = 4
# The gun gets room to be this much faster at the ends of a pass than its mean.
FASTER_ENDS = 1.3

# A candidate: the numbers of its line, standoff and lean.
Candidate = tuple[int, int, int]


def optimised(
    plain: Plan, progress: Callable[[str, float], None] = lambda what, share: None
) -> Plan:
    """The better plan that begins with a plain one, for the same mean film.

    Number and place of the passes follow from the film across them and the paint that they take;
    then speeds along them and where the gun opens, through the whole model. The cost is sigma_n
    squared, and the weights of the request times the paint sprayed over the paint wanted on the
    part, and the cycle time over that of the plain plan.

    Args:
        plain: as ``plan`` makes it.
        progress: called with what is done and its share, 0 to 1.
    """
    request, films = plain.request, plain.line_films
    target = request.target_um or plain.mean_um
    wanted_cm3 = target * float(plain.surface.vertex_areas_m2[plain.painted].sum())
    every = max(1, len(films.rows) // POINTS)
    search = LineSearch(
        films, FilmAtPoints(plain.surface, films.rows[::every], plain.model), plain.style, target,
        request.improvement(
            plain.style.overspray_m, target, paint_weight=request.paint_weight,
            time_weight=request.time_weight,
        ),
        wanted_cm3 / plain.model.planar.K1_cm3_per_s, plain.cycle_time_s,
        _standoffs_m(plain), np.unique(request.lean_max_rad * np.linspace(-1.0, 1.0, LEANS)),
    )  # fmt: skip
    low, high = films.surface_map.extent_m[1].tolist()
    found = []
    for count in range(1, len(plain.passes) + 2):
        progress('lines', count / (len(plain.passes) + 2))
        found.append(search.best(count, low, high))
    enough = min(lines.cost for lines in found) / (1.0 - WORTH_A_PASS)
    fewest = next(lines for lines in found if lines.cost <= enough)
    styles = tuple(planned.style for planned in plain.passes)
    even = Lines(plain.placing.lines_m, styles, np.inf)
    plans = []
    for number, lines in enumerate((fewest, even)):

        def show(what: str, share: float, number: int = number) -> None:
            progress(what, (number + share) / 2)

        plans.append(_along(plain, lines, target, wanted_cm3, show))
    costs = [
        one.sigma_n**2
        + request.paint_weight * one.paint.emitted_cm3 / wanted_cm3
        + request.time_weight * one.cycle_time_s / plain.cycle_time_s
        for one in plans
    ]
    return plans[int(costs[1] < (1.0 - WORTH_A_CHANGE) * costs[0])]


def _standoffs_m(plain: Plan) -> np.ndarray:
    """(S,) that each pass may have.

    Raises:
        PlanError: the standoff of the plain plan is not among those that are allowed.
    """
    given = plain.style.standoff_m
    low = plain.request.standoff_min_m or given
    high = plain.request.standoff_max_m or given
    if not low <= given <= high:
        raise PlanError(
            f'the standoff of the even passes, {given:g} m, is outside of {low:g} to {high:g} m; '
            'give a standoff within the range'
        )
    even = np.linspace(low, high, STANDOFFS)
    return np.unique(np.append(even[np.abs(even - given) > SAME_STANDOFF_M], given))


def _along(
    plain: Plan,
    lines: 'Lines',
    target_um: float,
    wanted_cm3: float,
    progress: Callable[[str, float], None],
) -> Plan:
    """The plan along lines, timed for evenness."""
    request, surface = plain.request, plain.surface
    speeds = np.clip(
        [style.speed_m_per_s for style in lines.styles],
        request.speed_min_m_per_s, request.speed_max_m_per_s,
    )  # fmt: skip
    style = replace(plain.style, speed_m_per_s=FASTER_ENDS * float(speeds.max()))
    order = slice(None) if request.direction == 'horizontal' else slice(None, None, -1)
    # All get the run-up of the fastest.
    roomy = [replace(s, speed_m_per_s=style.speed_m_per_s) for s in lines.styles]
    passes = tuple(
        replace(planned, style=replace(planned.style, speed_m_per_s=float(speed)))
        for planned, speed in zip(
            plan_passes(plain.line_films.surface_map, lines.lines_m[order], roomy[order]),
            speeds[order], strict=True,
        )
    )  # fmt: skip
    programme = Programme.of(trajectory_of(passes, style, plain.trajectory.frame_id))
    K1 = plain.model.planar.K1_cm3_per_s
    start_cm3 = K1 * sum(p.sprayed_m / p.speed_m_per_s for p in passes)
    wanted = request.improvement(
        plain.style.overspray_m, target_um,
        paint_weight=request.paint_weight * start_cm3 / wanted_cm3,
    )  # fmt: skip
    retimed = retime_for_evenness(
        surface, plain.painted, programme, [plain.model], wanted, progress, explained=False
    ).programme
    trajectory = retimed.trajectory()
    film, paint = simulated(
        surface, plain.model, trajectory, lambda share: progress('film', share)
    )
    area = surface.vertex_areas_m2[plain.painted]
    sigma_n = evenness(film[plain.painted], area)[1]
    index = float(np.diff(lines.lines_m).mean()) if len(passes) > 1 else 0.0
    return replace(
        plain, style=style, passes=passes, trajectory=trajectory, film_um=film, sigma_n=sigma_n,
        placing=Placing(len(passes), index, float(lines.lines_m.mean()), sigma_n),
        statistics=planned_statistics(film[plain.painted], area, paint.emitted_cm3, request),
        moves=tuple(moves_of(retimed, wanted)), plain=plain, paint=paint,
    )  # fmt: skip


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
        request: of robot and film; the weights are per paint and time of the next two.
        wanted_s, given_s: paint wanted on the part as time sprayed, and a usual cycle time [s].
        standoffs_m: (S,) to choose from. leans_rad: (L,) to choose from.
    """

    films: LineFilms
    at_points: FilmAtPoints
    style: PassStyle
    target_um: float
    request: ImproveRequest
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
            others = self._neighbours(now, step)
            costs = np.array([self._lines(other).cost for other in others])
            if costs.min() < (1.0 - WORTH_A_CHANGE) * self._lines(now).cost:
                now = others[int(np.argmax(costs <= (1.0 + WORTH_A_CHANGE) * costs.min()))]
            else:
                step //= 2
        return self._lines(now)

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
            motion = line_motion(self.films.surface_map, line, style, self.at_points.step_m)
            programme = Programme.of(motion)
            nodes = Nodes.of(programme.openings, self._spacing_m)
            even = np.full(len(nodes), 1.0 / style.speed_m_per_s)
            laid = self.at_points.of_nodes(programme, nodes, even)
            open_ends = may_be_closed(nodes, programme.openings, self.request)
            self._laid[candidate] = _Laid(laid / self.target_um, nodes.weights_m, open_ends)
        return self._laid[candidate]

    def _lines(self, some: tuple[Candidate, ...]) -> Lines:
        """Candidates run at the best speeds along them, with their cost."""
        if some in self._known:
            return self._known[some]
        laid = [self._laid_by(candidate) for candidate in some]
        films = np.concatenate([one.shares for one in laid])
        lengths = np.concatenate([one.lengths_m for one in laid])
        open_ends = np.concatenate([one.open_ends for one in laid])
        number = np.repeat(np.arange(len(some)), [len(one.lengths_m) for one in laid])
        request = self.request
        price = lengths * (
            request.paint_weight / self.wanted_s + request.time_weight / self.given_s
        )
        density = self._densities(films, number, open_ends, price)
        error = density @ films - 1.0
        seconds = np.bincount(number, lengths * density)
        metres = np.bincount(number, lengths * (density > 0.5 / request.speed_max_m_per_s))
        cost = float(np.mean(error**2) + price @ density)
        # Between passes the robot turns and comes back to speed.
        turn_s = 2.0 * self.style.speed_m_per_s / self.style.acceleration_m_per_s2
        cost += request.time_weight * len(some) * turn_s / self.given_s
        speeds = np.maximum(metres, 1e-3) / np.maximum(seconds, 1e-3)
        styles = tuple(
            replace(self._style(candidate), speed_m_per_s=float(speed))
            for candidate, speed in zip(some, speeds, strict=True)
        )
        lines = self.lines_m[[line for line, _, _ in some]]
        self._known[some] = Lines(lines, styles, cost)
        return self._known[some]

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
        matrix += 2.0 * self.request.smoothness / len(pairs) * change.T @ change
        least = np.where(open_ends, 0.0, 1.0 / self.request.speed_max_m_per_s)
        # A search among many sets of lines: quick rather than exact.
        answer = minimize(
            lambda y: (0.5 * y @ (found := matrix @ y) + linear @ y, found + linear),
            np.maximum(least, 2.0 * usual), jac=True, method='L-BFGS-B',
            bounds=Bounds(least, 1.0 / self.request.speed_min_m_per_s), options={'ftol': 1e-8},
        )  # fmt: skip
        return answer.x
