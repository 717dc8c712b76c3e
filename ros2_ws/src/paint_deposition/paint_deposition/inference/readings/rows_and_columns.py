"""Rows and columns among the places of readings that name no group."""

import numpy as np

from paint_deposition.motion.path import SprayPath
from paint_deposition.part.orientation import across_axis, downhill_axis
from paint_deposition.part.surface import Surface

FEWEST_ON_A_LINE = 3
# Lines lie this much further apart than the readings of one line stray from it.
CLEAR_RATIO = 3.0
# Readings on one line are not known to be straighter than this [m].
STRAIGHT_M = 1e-3
# So many of the points at least belong to a line, or there are none.
SHARE_ON_LINES = 0.8
# A single line is this much longer than wide.
SINGLE_RATIO = 10.0


def columns_or_rows(surface: Surface, path: SprayPath, positions_m: np.ndarray) -> np.ndarray:
    """(P,) labels 'column 1', ... from the left or 'row 1', ... from the top; '' for none.

    Where points lie in both, the lines that cross the passes are taken.

    Args:
        surface: the part, whose axes as the gun sees it tell left from right.
        path: that painted it.
        positions_m: (P, 3) of the points [m].
    """
    right = positions_m @ across_axis(surface.outward, surface.down)
    below = positions_m @ downhill_axis(surface.outward, surface.down)
    ways = [('column', right, below), ('row', below, right)]
    if not passes_are_level(path, surface.down):
        ways.reverse()
    for name, aside, along in ways:
        lines = _lines(aside, along)
        if lines is not None:
            return np.array([f'{name} {line + 1}' if line >= 0 else '' for line in lines])
    return np.full(len(positions_m), '')


def passes_are_level(path: SprayPath, down: np.ndarray) -> bool:
    """Whether the gun sprays more level than up and down."""
    motion = path.velocity_m_per_s[path.flow > 0.0]
    rising = float(np.abs(motion @ down).sum())
    return 2.0 * rising <= float(np.linalg.norm(motion, axis=1).sum())


def _lines(aside_m: np.ndarray, along_m: np.ndarray) -> np.ndarray | None:
    """(P,) number of the line of each point, -1 for none; None where there are no lines."""
    if len(aside_m) < FEWEST_ON_A_LINE:
        return None
    if np.ptp(aside_m) <= np.ptp(along_m) / SINGLE_RATIO:
        return np.zeros(len(aside_m), dtype=int)
    order = np.argsort(aside_m, kind='stable')
    gaps = np.diff(aside_m[order])
    largest = np.maximum(np.sort(gaps)[::-1], STRAIGHT_M)
    ratios = largest[:-1] / largest[1:]
    ratios = ratios[: len(aside_m) // FEWEST_ON_A_LINE]
    if not len(ratios) or ratios.max() < CLEAR_RATIO:
        return None
    least = largest[int(np.argmax(ratios))]
    cluster = np.empty(len(aside_m), dtype=int)
    cluster[order] = np.concatenate([[0], np.cumsum(gaps >= least)])
    counts = np.bincount(cluster)
    kept = counts >= FEWEST_ON_A_LINE
    widths = [np.ptp(aside_m[cluster == k]) for k in np.flatnonzero(kept)]
    if counts[kept].sum() < SHARE_ON_LINES * len(aside_m) or max(widths) > least:
        return None
    return np.where(kept, np.cumsum(kept) - 1, -1)[cluster]
