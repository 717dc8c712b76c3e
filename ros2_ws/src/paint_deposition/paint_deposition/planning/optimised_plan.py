"""A plan whose passes are as few as are worth their paint, with speeds of their own along them.

Each number of passes near that of the even plan is laid where its film is most even; the speeds
along the passes, and where the gun opens and closes, are then chosen through the whole model.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from paint_deposition.planning.films import predicted
from paint_deposition.planning.improvement.programme import Programme, moves_of
from paint_deposition.planning.improvement.retiming import retime_for_evenness
from paint_deposition.planning.passes import plan_passes, trajectory_of
from paint_deposition.planning.placing import Placing, best_placing
from paint_deposition.planning.plan import INDEX_SHARES, Plan

# A pass more must save this share of the cost: neither the last digits of a processor nor a gain
# that nobody would measure choose the number of passes.
WORTH_A_PASS = 0.05
# So many passes fewer, and more, than those of the even plan are tried.
FEWER, MORE = 2, 1
# The gun gets room to be this much faster at the ends of a pass than its mean.
FASTER_ENDS = 1.3


def optimised(
    plain: Plan, progress: Callable[[str, float], None] = lambda what, share: None
) -> Plan:
    """The better plan that begins with a plain one, for the same mean film.

    The cost is sigma_n squared, and the weights of the request times the paint sprayed over the
    paint wanted on the part, and the cycle time over that of the plain plan.
    """
    request, count = plain.request, len(plain.passes)
    target = request.target_um or plain.mean_um
    wanted_cm3 = target * float(plain.surface.vertex_areas_m2[plain.painted].sum())
    placings = [plain.placing]
    for passes in range(max(1, count - FEWER), count + MORE + 1):
        placing = _placed(plain, passes) if passes != count else None
        placings += [placing] if placing else []
    tried = []
    for number, placing in enumerate(sorted(placings, key=lambda one: one.passes)):

        def show(what: str, share: float, number: int = number) -> None:
            progress(what, (number + share) / len(placings))

        tried.append(_along(plain, placing, target, wanted_cm3, show))
    costs = [
        one.sigma_n**2
        + request.paint_weight * one.paint.emitted_cm3 / wanted_cm3
        + request.time_weight * one.cycle_time_s / plain.cycle_time_s
        for one in tried
    ]
    enough = min(costs) / (1.0 - WORTH_A_PASS)
    return next(one for one, cost in zip(tried, costs, strict=True) if cost <= enough)


def _placed(plain: Plan, passes: int) -> Placing | None:
    """So many passes where their film at one speed is most even; None where there is no room."""
    low, high = plain.line_films.surface_map.extent_m[1].tolist()
    least, most = (share * plain.plane.index_m for share in INDEX_SHARES)
    return best_placing(plain.line_films, (low, high), (least, most), passes)


def _along(
    plain: Plan,
    placing: Placing,
    target_um: float,
    wanted_cm3: float,
    progress: Callable[[str, float], None],
) -> Plan:
    """The plan along these lines, timed for evenness."""
    request, surface = plain.request, plain.surface
    even = plain.style.speed_m_per_s * placing.passes / len(plain.passes)
    speed = float(np.clip(even, request.speed_min_m_per_s, request.speed_max_m_per_s))
    # The run-up is that of the fastest.
    style = replace(plain.style, speed_m_per_s=FASTER_ENDS * speed)
    lines = placing.lines_m if request.direction == 'horizontal' else placing.lines_m[::-1]
    passes = tuple(
        replace(planned, style=replace(style, speed_m_per_s=speed))
        for planned in plan_passes(plain.line_films.surface_map, lines, [style] * len(lines))
    )
    programme = Programme.of(trajectory_of(passes, style, plain.trajectory.frame_id))
    start_cm3 = plain.model.planar.K1_cm3_per_s * sum(p.sprayed_m / speed for p in passes)
    wanted = request.improvement(
        plain.style.overspray_m, target_um,
        paint_weight=request.paint_weight * start_cm3 / wanted_cm3,
    )  # fmt: skip
    retimed = retime_for_evenness(
        surface, plain.painted, programme, [plain.model], wanted, progress, explained=False
    ).programme
    found = predicted(
        surface, plain.model, request, plain.painted, retimed.trajectory(),
        lambda share: progress('film', share),
    )  # fmt: skip
    return replace(
        plain, **found, style=style, passes=passes, moves=tuple(moves_of(retimed, wanted)),
        placing=replace(placing, sigma_n=found['sigma_n']), plain=plain,
    )  # fmt: skip
