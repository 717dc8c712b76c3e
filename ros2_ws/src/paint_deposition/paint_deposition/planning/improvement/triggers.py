"""Where the gun had better open and close: the ends of the openings, from a relaxed problem."""

from dataclasses import replace

import numpy as np

from paint_deposition.planning.improvement.limits import Limits
from paint_deposition.planning.improvement.nodes import Nodes, SpeedBounds
from paint_deposition.planning.improvement.programme import Opening, Programme

# An opening is not cut to less than this share of its length.
LEAST_SHARE = 0.3
# It is extended only where the path runs on straight, at nearly the speed of its end.
STRAIGHT, STEADY = 0.995, 0.99
CHECKS = 20


def widened(programme: Programme, limits: Limits) -> tuple[Opening, ...]:
    """The openings with all places at which the gun might open earlier or close later."""
    ends = [(o.on_m, o.off_m) for o in programme.openings]
    found = []
    for number, opening in enumerate(programme.openings):
        before = ends[number - 1][1] if number else 0.0
        after = ends[number + 1][0] if number + 1 < len(ends) else float(programme.travel_m[-1])
        # Two openings may meet half way between them.
        back = min(limits.trigger_shift_m, (0.5 if number else 1.0) * (opening.on_m - before))
        last = number + 1 == len(ends)
        ahead = min(limits.trigger_shift_m, (1.0 if last else 0.5) * (after - opening.off_m))
        found.append(
            replace(
                opening,
                on_m=opening.on_m - _usable(programme, opening.on_m, -1.0, back),
                off_m=opening.off_m + _usable(programme, opening.off_m, 1.0, ahead),
            )
        )
    return tuple(found)


def _usable(programme: Programme, from_m: float, side: float, most_m: float) -> float:
    """How far the path runs on from an end, straight and steadily."""
    if most_m <= 0.0:
        return 0.0
    way = np.linspace(0.0, most_m, CHECKS + 1)
    places = from_m + side * way
    at = programme.positions_at_m(places)
    seconds = np.abs(np.diff(programme.seconds_at(places)))
    speed = np.diff(way) / np.maximum(seconds, 1e-9)
    inner = from_m - side * way[1]
    own = way[1] / max(float(np.ptp(programme.seconds_at(np.array([inner, from_m])))), 1e-9)
    good = speed >= STEADY * own
    good &= np.linalg.norm(at[1:] - at[0], axis=1) >= STRAIGHT * way[1:]
    return float(way[np.argmin(good)] if not good.all() else way[-1])


def may_be_closed(nodes: Nodes, given: tuple[Opening, ...], limits: Limits) -> np.ndarray:
    """(n,) bool, nodes so near the given ends that the gun may be closed there."""
    near = np.zeros(len(nodes), dtype=bool)
    if not limits.trigger_cut_m and not limits.trigger_shift_m:
        return near
    for number, opening in enumerate(given):
        rows = nodes.rows(number)
        cut = _most_cut_m(opening, limits)
        place = nodes.travel_m[rows]
        near[rows] = (place < opening.on_m + cut) | (place > opening.off_m - cut)
    return near


def chosen(
    nodes: Nodes,
    density: np.ndarray,
    open_ends: np.ndarray,
    bounds: SpeedBounds,
    given: tuple[Opening, ...],
    limits: Limits,
) -> tuple[Opening, ...]:
    """Openings that begin and end where the relaxed density reaches half of the least possible."""
    found = []
    for number, opening in enumerate(nodes.openings):
        rows = nodes.rows(number)
        place = nodes.travel_m[rows]
        least = opening.flow / bounds.greatest_m_per_s[rows]
        worth = (density[rows] - 0.5 * least) / least
        cut = _most_cut_m(given[number], limits)
        kept = np.flatnonzero(~open_ends[rows] | (worth > 0.0))
        first, last = int(kept[0]), int(kept[-1])
        found.append(
            Opening(
                min(_crossing(place, worth, first, first - 1), given[number].on_m + cut),
                max(_crossing(place, worth, last, last + 1), given[number].off_m - cut),
                opening.flow,
                opening.brush,
            )
        )
    return tuple(found)


def _most_cut_m(opening: Opening, limits: Limits) -> float:
    length = opening.off_m - opening.on_m
    return min(limits.trigger_cut_m, 0.5 * (1.0 - LEAST_SHARE) * length)


def _crossing(place_m: np.ndarray, worth: np.ndarray, inside: int, outside: int) -> float:
    """Where the worth vanishes between a node and the next one outward."""
    if not 0 <= outside < len(place_m):
        return float(place_m[inside])
    share = max(worth[inside], 0.0) / max(worth[inside] - worth[outside], 1e-12)
    step = place_m[outside] - place_m[inside]
    return float(place_m[inside] + np.clip(share, 0.0, 1.0) * step)
