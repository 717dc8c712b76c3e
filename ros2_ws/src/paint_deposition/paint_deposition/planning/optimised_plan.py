"""A plan whose passes are as few as are worth their paint, with speeds of their own along them."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from paint_deposition.planning.improvement.dwell_films import FilmAtPoints
from paint_deposition.planning.improvement.improve import timed_for_evenness
from paint_deposition.planning.improvement.limits import Limits, Wish
from paint_deposition.planning.improvement.moves import moves_of
from paint_deposition.planning.improvement.programme import Programme
from paint_deposition.planning.optimised_lines import POINTS, Lines, LineSearch
from paint_deposition.planning.pass_motion import trajectory_of
from paint_deposition.planning.pass_placement import Placing
from paint_deposition.planning.passes import plan_passes
from paint_deposition.planning.plan import Plan, evenness, planned_statistics, simulated

# Of the numbers of passes, so many that promise most are followed up.
FOLLOWED = 2
# The gun gets room to be this much faster at the ends of a pass than its mean.
FASTER_ENDS = 1.3


@dataclass(frozen=True)
class _Candidate:
    plan: Plan
    cost: float


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
    surface, request = plain.surface, plain.request
    area = float(surface.vertex_areas_m2[plain.painted].sum())
    target = request.target_um or plain.mean_um
    wanted_cm3 = target * area
    limits = _limits(plain)
    wish = Wish(target, paint_weight=request.paint_weight, time_weight=request.time_weight)
    every = max(1, len(plain.line_films.rows) // POINTS)
    at_points = FilmAtPoints(surface, plain.line_films.rows[::every], plain.model)
    search = LineSearch(
        plain.line_films, at_points, plain.style, target, limits, wish,
        wanted_cm3 / plain.model.planar.K1_cm3_per_s, plain.cycle_time_s,
        lambda share: progress('candidate lines', share),
    )  # fmt: skip
    low, high = plain.line_films.surface_map.extent_m[1].tolist()
    lines = []
    for count in range(1, len(plain.passes) + 2):
        progress('lines', count / (len(plain.passes) + 2))
        lines.append(search.best(count, low, high))
    promising = sorted(lines, key=lambda found: found.cost)[:FOLLOWED]
    speeds = np.array([planned.speed_m_per_s for planned in plain.passes])
    promising.append(Lines(plain.placing.lines_m, speeds, np.inf))
    candidates = []
    for number, found in enumerate(promising):

        def tell(what: str, share: float, number: int = number) -> None:
            progress(what, (number + share) / len(promising))

        candidates.append(_followed(plain, found, target, wanted_cm3, tell))
    return min(candidates, key=lambda candidate: candidate.cost).plan


def _limits(plain: Plan) -> Limits:
    """Of the request; the gun may be closed up to the edge of the part."""
    request = plain.request
    return Limits(
        speed_min_m_per_s=request.speed_min_m_per_s,
        speed_max_m_per_s=request.speed_max_m_per_s,
        acceleration_m_per_s2=request.acceleration_m_per_s2,
        trigger_cut_m=plain.style.overspray_m,
    )


def _followed(
    plain: Plan,
    lines: Lines,
    target_um: float,
    wanted_cm3: float,
    progress: Callable[[str, float], None],
) -> _Candidate:
    """The plan along lines, with its cost."""
    request, surface = plain.request, plain.surface
    speeds = np.clip(lines.speeds_m_per_s, request.speed_min_m_per_s, request.speed_max_m_per_s)
    style = replace(plain.style, speed_m_per_s=FASTER_ENDS * float(speeds.max()))
    places = lines.lines_m
    if request.direction != 'horizontal':
        places, speeds = places[::-1], speeds[::-1]
    passes = tuple(
        replace(planned, speed_m_per_s=float(speed))
        for planned, speed in zip(
            plan_passes(plain.line_films.surface_map, places, style), speeds, strict=True
        )
    )
    programme = Programme.of(trajectory_of(passes, style, plain.trajectory.frame_id))
    K1 = plain.model.planar.K1_cm3_per_s
    start_cm3 = K1 * sum(p.sprayed_m / p.speed_m_per_s for p in passes)
    wish = Wish(target_um, paint_weight=request.paint_weight * start_cm3 / wanted_cm3)
    limits = _limits(plain)
    retiming = timed_for_evenness(
        surface, plain.painted, programme, [plain.model], limits, wish, progress,
        explained=False,
    )  # fmt: skip
    trajectory = retiming.programme.trajectory()
    film, paint = simulated(
        surface, plain.model, trajectory, lambda share: progress('film', share)
    )
    area = surface.vertex_areas_m2[plain.painted]
    _, sigma_n = evenness(film[plain.painted], area)
    statistics = planned_statistics(film[plain.painted], area, paint.emitted_cm3, request)
    index = float(np.diff(lines.lines_m).mean()) if len(passes) > 1 else 0.0
    placing = Placing(len(passes), index, float(lines.lines_m.mean()), sigma_n)
    found = replace(
        plain, style=style, placing=placing, passes=passes, trajectory=trajectory, film_um=film,
        statistics=statistics, sigma_n=sigma_n, moves=tuple(moves_of(retiming.programme, limits)),
        plain=plain, paint=paint,
    )  # fmt: skip
    cost = sigma_n**2 + request.paint_weight * paint.emitted_cm3 / wanted_cm3
    cost += request.time_weight * found.cycle_time_s / plain.cycle_time_s
    return _Candidate(found, cost)
