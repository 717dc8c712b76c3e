"""Speeds, flows and triggers along a given path, chosen for an even film through the model."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.part.surface import Surface
from paint_deposition.planning.improvement.dwell_films import FilmAtPoints
from paint_deposition.planning.improvement.limits import Limits, Wish
from paint_deposition.planning.improvement.nodes import Nodes, speed_bounds, timed_anew
from paint_deposition.planning.improvement.programme import Programme
from paint_deposition.planning.improvement.quadratic_program import (
    WORDS,
    Density,
    Problem,
    solved,
)
from paint_deposition.planning.improvement.triggers import chosen, may_be_closed, widened
from paint_deposition.planning.pass_films import spread

# Nodes per width of the pattern, within bounds.
NODES_PER_SIGMA = 2.0
FINEST_M, COARSEST_M = 0.015, 0.05
# The film that was foretold and the one that is laid agree to this share of the target.
AGREED, ROUNDS = 5e-4, 4
# Rounds of the solver for what need not be exact: triggers, and what limits cost.
ROUGHLY = 3
# A limit without which sigma_n would fall by this share holds the film back.
HOLDS_BACK = 0.02


@dataclass(frozen=True)
class HeldBack:
    """A limit that keeps the film from being more even.

    Attributes:
        name: of the limit, in words. sigma_n: what it would be without this limit alone.
    """

    name: str
    sigma_n: float


@dataclass(frozen=True)
class Retiming:
    """A programme timed anew.

    Attributes:
        given: the programme as it was; programme: the one with new times and openings.
        nodes, density: of the solution: flow times slowness [s/m].
        target_um: mean film aimed at.
        sigma_n: before and after, at the points of the search, mean over the models.
        sigma_n_of: (D,) after, for each of the models.
        held_back: by these limits, the strongest first.
        sigma_n_of_path: what any speeds at all along this path would reach.
        rounds: of solving and laying the film.
    """

    given: Programme
    programme: Programme
    nodes: Nodes
    density: Density
    target_um: float
    sigma_n: tuple[float, float]
    held_back: tuple[HeldBack, ...]
    sigma_n_of_path: float
    rounds: int


def timed_for_evenness(
    surface: Surface,
    judged: np.ndarray,
    programme: Programme,
    models: Sequence[DepositionModel],
    limits: Limits,
    wish: Wish,
    progress: Callable[[str, float], None] = lambda what, share: None,
    explained: bool = True,
) -> Retiming:
    """Choose speeds, flows and triggers along the path of a programme.

    The film at points spread evenly over the judged side is linear in the density of paint along
    the path: a quadratic program gives the best one. Effects that ask for speed, time or film are
    followed by solving again about the film of the last solution.

    Args:
        surface: the part. judged: (V,) bool, vertices whose film counts.
        programme: as given.
        models: equally likely ones; the first is the best known.
        limits, wish: of the user.
        progress: called with what is done and its share, 0 to 1.
        explained: find out which limits hold the film back.

    Raises:
        PlanError: the limits contradict each other.
    """
    rows = np.flatnonzero(judged)[spread(surface.vertex_areas_m2[judged])]
    films = [FilmAtPoints(surface, rows, model) for model in models]
    before = [one.film_um(programme) for one in films]
    mean = float(before[0].mean())
    target = wish.target_um or mean
    narrow = min(min(p.sigma1_m, p.sigma2_m) for m in models for p in m.patterns)
    spacing = min(max(narrow / NODES_PER_SIGMA, FINEST_M), COARSEST_M)
    search = _Search(films, target, target / mean, limits, wish, spacing, progress, explained)
    relaxed = replace(programme, openings=widened(programme, limits))
    shifted = search.openings(programme, relaxed)
    return search.timed(programme, shifted, before)


@dataclass(frozen=True)
class _Search:
    films: Sequence[FilmAtPoints]
    target_um: float
    level: float
    limits: Limits
    wish: Wish
    spacing_m: float
    progress: Callable[[str, float], None]
    explained: bool

    def openings(self, given: Programme, wide: Programme) -> Programme:
        """The programme with the gun open where a relaxed problem wants it."""
        nodes = Nodes.of(wide.openings, self.spacing_m)
        open_ends = may_be_closed(nodes, given.openings, self.limits)
        if not open_ends.any():
            return given
        self.progress('triggers', 0.0)
        problem, start, _ = self._problem(wide, given, nodes, None, open_ends)
        found = solved(problem, start, ROUGHLY)
        openings = chosen(
            nodes, found.density, open_ends, problem.bounds, given.openings, self.limits
        )
        return given.with_openings(openings)

    def timed(
        self, given: Programme, programme: Programme, before: Sequence[np.ndarray]
    ) -> Retiming:
        """Solve and lay the film until both agree."""
        nodes = Nodes.of(programme.openings, self.spacing_m)
        closed = np.zeros(len(nodes), dtype=bool)
        density: Density | None = None
        for round_ in range(1, ROUNDS + 1):
            self.progress('speeds', (round_ - 1) / ROUNDS)
            problem, start, _ = self._problem(programme, given, nodes, density, closed)
            density = solved(problem, start)
            timed = self._timed(programme, nodes, density)
            foretold = [density.density @ films for films in problem.films]
            laid = [one.film_um(timed) for one in self.films]
            off = max(float(np.abs(a - b).max()) for a, b in zip(foretold, laid, strict=True))
            if off <= AGREED * self.target_um:
                break
        assert density is not None
        now = _sigma_n(laid)
        held: tuple[HeldBack, ...] = ()
        of_path = now
        if self.explained:
            held = self._held_back(problem, density, now)
            of_path = self._without(problem, density, frozenset(WORDS) - {'flow'})
        return Retiming(
            given, timed, nodes, density, self.target_um, (_sigma_n(before), now), held, of_path,
            round_,
        )  # fmt: skip

    def _problem(
        self,
        programme: Programme,
        given: Programme,
        nodes: Nodes,
        density: Density | None,
        open_ends: np.ndarray,
    ) -> tuple[Problem, Density, Programme]:
        """The problem about a density; without one, about even speeds."""
        bounds = speed_bounds(given.with_openings(programme.openings), nodes, self.limits)
        now = density or _even(given, nodes, self.level, self.limits)
        timed = self._timed(programme, nodes, now)
        films = [one.of_nodes(timed, nodes, now.density).per_density_um for one in self.films]
        sprayed = self.level * _sprayed_s(given)
        problem = Problem(
            films, self.target_um, nodes, bounds, self.limits, self.wish, sprayed, open_ends
        )
        return problem, now, timed

    def _timed(self, programme: Programme, nodes: Nodes, density: Density) -> Programme:
        openings = tuple(
            replace(opening, flow=float(flow))
            for opening, flow in zip(nodes.openings, density.flow, strict=True)
        )
        slowness = density.slowness(nodes)
        return timed_anew(programme.with_openings(openings), nodes, slowness, self.limits)

    def _held_back(self, problem: Problem, found: Density, sigma_n: float) -> tuple[HeldBack, ...]:
        held = []
        for number, name in enumerate(found.pulling):
            self.progress('limits', number / len(found.pulling))
            if name not in WORDS:
                continue
            without = self._without(problem, found, frozenset({name}))
            if without < (1.0 - HOLDS_BACK) * sigma_n:
                held.append(HeldBack(WORDS[name], without))
        return tuple(sorted(held, key=lambda limit: limit.sigma_n))

    def _without(self, problem: Problem, found: Density, names: frozenset[str]) -> float:
        free = solved(replace(problem, without=names), found, ROUGHLY)
        return _sigma_n([free.density @ films for films in problem.films])


def _even(given: Programme, nodes: Nodes, level: float, limits: Limits) -> Density:
    """The mean density of each opening as it was given, times a level."""
    flow = np.array([opening.flow for opening in nodes.openings])
    ends = np.array([[o.on_m, o.off_m] for o in given.openings])
    seconds = np.diff(given.seconds_at(ends), axis=1)[:, 0]
    slowness = np.clip(
        level * seconds / np.diff(ends, axis=1)[:, 0],
        1.0 / limits.speed_max_m_per_s,
        1.0 / limits.speed_min_m_per_s,
    )
    return Density((flow * slowness)[nodes.opening], flow)


def _sprayed_s(programme: Programme) -> float:
    """Time sprayed, weighted by the flow [s]."""
    ends = np.array([[o.on_m, o.off_m] for o in programme.openings])
    flow = np.array([o.flow for o in programme.openings])
    return float(flow @ np.diff(programme.seconds_at(ends), axis=1)[:, 0])


def _sigma_n(films_um: Sequence[np.ndarray]) -> float:
    """Root mean square over the models of standard deviation over mean."""
    return math.sqrt(float(np.mean([(f.std() / f.mean()) ** 2 for f in films_um])))
