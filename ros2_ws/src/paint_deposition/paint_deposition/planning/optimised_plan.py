"""A plan whose passes are as few as are worth their paint, with speeds of their own along them."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from paint_deposition.errors import PlanError, require_above_zero
from paint_deposition.planning.improvement.dwell_films import FilmAtPoints
from paint_deposition.planning.improvement.improve import timed_for_evenness
from paint_deposition.planning.improvement.limits import Wish
from paint_deposition.planning.improvement.moves import moves_of
from paint_deposition.planning.improvement.programme import Programme
from paint_deposition.planning.optimised_lines import LEANS, POINTS, STANDOFFS, Lines, LineSearch
from paint_deposition.planning.pass_motion import trajectory_of
from paint_deposition.planning.pass_placement import Placing
from paint_deposition.planning.passes import plan_passes
from paint_deposition.planning.plan import Plan, evenness, planned_statistics, simulated

# Of the numbers of passes, so many that promise most are followed up.
FOLLOWED = 2
# Standoffs closer together are the same.
NO_OTHER_M = 1e-4
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
    limits = request.limits(plain.style.overspray_m)
    wish = Wish(target, paint_weight=request.paint_weight, time_weight=request.time_weight)
    every = max(1, len(plain.line_films.rows) // POINTS)
    at_points = FilmAtPoints(surface, plain.line_films.rows[::every], plain.model)
    search = LineSearch(
        plain.line_films, at_points, plain.style, target, limits, wish,
        wanted_cm3 / plain.model.planar.K1_cm3_per_s, plain.cycle_time_s,
        _standoffs_m(plain), np.unique(request.lean_max_rad * np.linspace(-1.0, 1.0, LEANS)),
    )  # fmt: skip
    low, high = plain.line_films.surface_map.extent_m[1].tolist()
    lines = []
    for count in range(1, len(plain.passes) + 2):
        progress('lines', count / (len(plain.passes) + 2))
        lines.append(search.best(count, low, high))
    promising = sorted(lines, key=lambda found: found.cost)[:FOLLOWED]
    styles = tuple(planned.style for planned in plain.passes)
    promising.append(Lines(plain.placing.lines_m, styles, np.inf))
    candidates = []
    for number, found in enumerate(promising):

        def tell(what: str, share: float, number: int = number) -> None:
            progress(what, (number + share) / len(promising))

        candidates.append(_followed(plain, found, target, wanted_cm3, tell))
    return min(candidates, key=lambda candidate: candidate.cost).plan


def _standoffs_m(plain: Plan) -> np.ndarray:
    """(S,) that each pass may have.

    Raises:
        PlanError: the standoff of the plain plan is not among those that are allowed.
    """
    given = plain.style.standoff_m
    low = given if plain.request.standoff_min_m is None else plain.request.standoff_min_m
    high = given if plain.request.standoff_max_m is None else plain.request.standoff_max_m
    require_above_zero(standoff_min_m=low)
    if not low <= given <= high:
        raise PlanError(
            f'the standoff of the even passes, {given:g} m, is outside of {low:g} to {high:g} m; '
            'give a standoff within the range'
        )
    even = np.linspace(low, high, STANDOFFS)
    return np.unique(np.append(even[np.abs(even - given) > NO_OTHER_M], given))


def _followed(
    plain: Plan,
    lines: Lines,
    target_um: float,
    wanted_cm3: float,
    progress: Callable[[str, float], None],
) -> _Candidate:
    """The plan along lines, with its cost."""
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
    wish = Wish(target_um, paint_weight=request.paint_weight * start_cm3 / wanted_cm3)
    limits = request.limits(plain.style.overspray_m)
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
