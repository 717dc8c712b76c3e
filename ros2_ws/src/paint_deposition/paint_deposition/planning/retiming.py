"""Speeds, flows and triggers along a given path, chosen for an even film through the model."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.motion.programmed import Move
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.part.surface import Surface
from paint_deposition.planning.nodes import FilmAtPoints, Nodes, retime, speed_bounds
from paint_deposition.planning.passes import PlannedPass
from paint_deposition.planning.planned_film import WantedFilm, stratified_sample
from paint_deposition.planning.programme import Programme, moves_of
from paint_deposition.planning.quadratic_program import Problem, solve
from paint_deposition.planning.requests import ImproveRequest, PlanRequest, SpeedLimits

# Rounds of the solver where an approximate solution is enough: triggers, and the cost of limits.
ROUGH_ROUNDS = 3


def retime_for_evenness(
    surface: Surface,
    wanted: WantedFilm,
    original: Programme,
    models: Sequence[DepositionModel],
    request: ImproveRequest,
    progress: Callable[[str, float], None] = lambda what, share: None,
    explain: bool = True,
) -> tuple[Programme, tuple[str, ...], dict[str, float], float]:
    """Choose speeds, flows and triggers along the path of a programme.

    The film at points spread evenly over the region where one is wanted is linear in the density
    of paint along the path: a quadratic program gives the best one. Films here are over the share
    of their own target in the mean target: they are even where each zone has its target. Effects
    that depend on speed, time or film are updated by solving again about the film of the last
    solution. The models are equally likely, the first is the best known. ``explain`` also
    determines which limits cost evenness, and how even the film along this path could be.

    Returns:
        The new programme; the names of all limits that bind; those of them that cost evenness, the
        strongest first, with sigma_n without each alone; and sigma_n of the most even film of any
        densities of paint along this path, without limits and without weights for paint, time and
        smoothness.

    Raises:
        PaintError: the limits contradict each other.
    """
    rows = np.flatnonzero(wanted.region)
    rows = rows[stratified_sample(surface.vertex_areas_m2[wanted.region])]
    films = [FilmAtPoints(surface, rows, model, wanted.share[rows]) for model in models]
    mean_um = float(films[0].film_um(original).mean())
    target_um = wanted.target_um or request.target_um or mean_um
    bands = wanted.bands(rows, target_um, request.tolerance)
    narrow = min(min(p.sigma1_m, p.sigma2_m) for m in models for p in m.patterns)
    # Nodes per width of the pattern, within bounds.
    spacing_m = min(max(narrow / 2.0, 0.015), 0.05)
    lengths_m = np.diff(original.ends_m)[:, 0]
    seconds, level = np.diff(original.seconds_at(original.ends_m))[:, 0], target_um / mean_um
    fastest, slowest = request.speed_max_m_per_s, request.speed_min_m_per_s
    # (m,) density of paint that is the original mean of each opening.
    even = original.flow * np.clip(level * seconds / lengths_m, 1.0 / fastest, 1.0 / slowest)

    def timed_at(nodes: Nodes, density: np.ndarray, flow: np.ndarray) -> Programme:
        programme = replace(original, ends_m=nodes.ends_m, flow=flow)
        return retime(programme, nodes, density / flow[nodes.opening], request)

    def problem_about(
        nodes: Nodes, density: np.ndarray, flow: np.ndarray, open_ends: np.ndarray
    ) -> Problem:
        bounds = speed_bounds(replace(original, ends_m=nodes.ends_m), nodes, request)
        timed = timed_at(nodes, density, flow)
        of_nodes = [one.of_nodes(timed, nodes, density) for one in films]
        sprayed_s = level * float(original.flow @ seconds)
        return Problem(
            of_nodes, target_um, bands, original.flow, nodes, bounds, request, sprayed_s,
            open_ends,
        )  # fmt: skip

    # Choose where the gun opens; then solve and simulate in turn until both films agree.
    progress('triggers', 0.0)
    ends_m, free = original.ends_m, []
    nodes = Nodes.of(_widened_m(original, request), spacing_m)
    # (m, 2) latest place at which each opening may begin, and earliest at which it may end: it is
    # not cut to less than 30 % of its length.
    cut_m = np.minimum(request.trigger_cut_m, 0.35 * lengths_m)
    kept_m = original.ends_m + np.outer(cut_m, [1.0, -1.0])
    latest_m, earliest_m = kept_m[nodes.opening].T
    open_ends = (nodes.travel_m < latest_m) | (nodes.travel_m > earliest_m)
    if open_ends.any():
        start = even[nodes.opening], original.flow
        relaxed = problem_about(nodes, *start, open_ends)
        density, flow, _ = solve(relaxed, *start, ROUGH_ROUNDS)
        ends_m = _ends_m(relaxed, density, kept_m)
        free = [(relaxed, density, flow)]
    nodes = Nodes.of(ends_m, spacing_m)
    closed = np.zeros(len(nodes), dtype=bool)
    density, flow, rounds = even[nodes.opening], original.flow, 4
    for round_ in range(rounds):
        progress('speeds', round_ / rounds)
        problem = problem_about(nodes, density, flow, closed)
        density, flow, binding = solve(problem, density, flow)
        timed = timed_at(nodes, density, flow)
        laid = [one.film_um(timed) for one in films]
        expected = problem.films_um(density)
        off = max(float(np.abs(a - b).max()) for a, b in zip(expected, laid, strict=True))
        # The film of the solution and that of the timed programme agree.
        if off <= 5e-4 * target_um:
            break
    limits: dict[str, float] = {}
    of_path = now = _sigma_n(laid)
    if explain:
        for number, name in enumerate(binding):
            progress('limits', number / len(binding))
            freed = replace(problem, left_out=frozenset({name}))
            without = _sigma_n(freed.films_um(solve(freed, density, flow, ROUGH_ROUNDS)[0]))
            # A limit is reported if sigma_n would be lower by 2 % without it.
            if without < 0.98 * now:
                limits[name] = without
        limits = dict(sorted(limits.items(), key=lambda limit: limit[1]))
        for one, near, given in ((problem, density, flow), *free):
            bare = one.relaxed()
            most_even, *_ = solve(bare, near, given, ROUGH_ROUNDS)
            of_path = min(of_path, _sigma_n(bare.films_um(most_even)))
    return timed, binding, limits, of_path


def timed_evenly(
    surface: Surface,
    model: DepositionModel,
    request: PlanRequest,
    wanted: WantedFilm,
    passes: Sequence[PlannedPass],
    trajectory: Trajectory,
    target_um: float | None,
    wanted_cm3: float,
    cycle_time_s: float,
    progress: Callable[[str, float], None],
) -> tuple[Trajectory, tuple[Move, ...]]:
    """The motion along planned passes at the speeds that lay an even film, and its moves.

    The weights of the request are for the paint that the passes spray over the paint wanted, and
    for the time that they spray over the cycle time of the plan to begin with.
    """
    sprayed_s = sum((one.off_m - one.on_m) / one.speed_m_per_s for one in passes)
    sprayed_cm3 = model.planar.K1_cm3_per_s * sprayed_s
    names = (*SpeedLimits.model_fields, 'acceleration_m_per_s2')
    asked = ImproveRequest(
        **{name: getattr(request, name) for name in names},
        target_um=target_um,
        # The gun may be closed up to the edge of the part.
        trigger_cut_m=passes[0].style.overspray_m,
        paint_weight=sprayed_cm3 / wanted_cm3 * request.paint_weight,
        time_weight=sprayed_s / cycle_time_s * request.time_weight,
    )
    original = Programme.of(trajectory)
    retimed, *_ = retime_for_evenness(
        surface, wanted, original, [model], asked, progress, explain=False
    )
    return retimed.trajectory(), tuple(moves_of(retimed, asked))


def _sigma_n(films_um: Sequence[np.ndarray]) -> float:
    """Root mean square over the models of standard deviation over mean."""
    return math.sqrt(float(np.mean([(f.std() / f.mean()) ** 2 for f in films_um])))


# --- where the gun opens and closes: the ends of the openings, from a relaxed problem


def _widened_m(programme: Programme, request: ImproveRequest) -> np.ndarray:
    """(k, 2) ends of the openings with all places where the gun might open or close."""
    room_m = (programme.ends_m - programme.around_m) * np.array([1.0, -1.0])
    # Two openings may meet half way between them.
    room_m[1:, 0] *= 0.5
    room_m[:-1, 1] *= 0.5
    most_m = np.minimum(request.trigger_shift_m, room_m).tolist()
    found = [
        (on - _usable_m(programme, on, -1.0, back), off + _usable_m(programme, off, 1.0, ahead))
        for (on, off), (back, ahead) in zip(programme.ends_m.tolist(), most_m, strict=True)
    ]
    return np.array(found)


def _usable_m(programme: Programme, from_m: float, side: float, most_m: float) -> float:
    """How far the path continues from an end, straight and at a steady speed."""
    if most_m <= 0.0:
        return 0.0
    way = np.linspace(0.0, most_m, 21)
    places = from_m + side * way
    at = programme.positions_at_m(places)
    seconds = np.abs(np.diff(programme.seconds_at(places)))
    speed = np.diff(way) / np.maximum(seconds, 1e-9)
    # The opening may end in a turn: it runs on straight as seen from inside.
    inside = np.array([from_m - side * way[1], from_m])
    own = way[1] / max(float(np.ptp(programme.seconds_at(inside))), 1e-9)
    # It is extended only where the path runs on straight, at nearly the speed of its end.
    good = speed >= 0.99 * own
    off = np.linalg.norm(at[1:] - programme.positions_at_m(inside[:1]), axis=1)
    good &= off >= 0.995 * (way[1:] + way[1])
    return float(way[np.argmin(good)] if not good.all() else way[-1])


def _ends_m(relaxed: Problem, density: np.ndarray, kept_m: np.ndarray) -> np.ndarray:
    """(m, 2) where the relaxed density reaches half of the least possible in each opening.

    It begins no later and ends no earlier than at ``kept_m`` (m, 2).
    """
    found, nodes = [], relaxed.nodes
    for number, (latest, earliest) in enumerate(kept_m.tolist()):
        rows = nodes.rows(number)
        place = nodes.travel_m[rows]
        least = relaxed.given_flow[number] / relaxed.bounds[0][rows]
        worth = (density[rows] - 0.5 * least) / least
        kept = np.flatnonzero(~relaxed.open_ends[rows] | (worth > 0.0))
        first, last = int(kept[0]), int(kept[-1])
        on = min(_crossing_m(place, worth, first, first - 1), latest)
        off = max(_crossing_m(place, worth, last, last + 1), earliest)
        found.append((on, off))
    return np.array(found)


def _crossing_m(place_m: np.ndarray, worth: np.ndarray, inside: int, outside: int) -> float:
    """Where the worth crosses zero between a node and the next one outward."""
    if not 0 <= outside < len(place_m):
        return float(place_m[inside])
    share = max(worth[inside], 0.0) / max(worth[inside] - worth[outside], 1e-12)
    step = place_m[outside] - place_m[inside]
    return float(place_m[inside] + np.clip(share, 0.0, 1.0) * step)
