"""Parallel passes over a plane: how the gun runs along them, how many it takes, and how long."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.pass_film import sampled_collapse
from paint_deposition.model.eq3_collapse import Collapse
from paint_deposition.model.eq4_eq5_uniformity import ParallelPasses, Variation, variation

# Passes that differ by less than this share of their peak are taken for the same.
ALIKE = 1e-9
# Passes that are kept for requests that differ in tolerance or width only.
PASSES_KEPT = 64
# Share by which the film at the part's edge may fall below the least film inside.
EDGE_LOSS = 0.05


@dataclass(frozen=True)
class PassSetup:
    """Square to a plane, in parallel passes.

    A gun that keeps its orientation lays one profile whichever way it travels, so alternating
    passes are as good as one-way ones. Turned by half a turn for every way back it lays the
    mirrored profile, and an asymmetric pattern makes an uneven pair.

    Attributes:
        standoff_m: TCP to plane [m].
        travel_rad: direction of the first pass in the tool's x-y frame, from x to y [rad].
        one_way: every pass runs in the direction of the first; else they alternate.
        gun_turns: on the way back the gun is turned by half a turn about its axis.
    """

    standoff_m: float
    travel_rad: float = 0.0
    one_way: bool = False
    gun_turns: bool = False

    @property
    def travel(self) -> str:
        """'one_way' or 'alternating'."""
        return 'one_way' if self.one_way else 'alternating'

    @property
    def assumption(self) -> str:
        """What is assumed about the gun, in words."""
        if self.one_way:
            return 'all passes run the same way with the gun held alike'
        if self.gun_turns:
            return 'passes alternate and the gun turns by 180 deg with them: every other mirrored'
        return 'passes alternate and the gun keeps its orientation: all lay the same profile'

    @lru_cache(maxsize=PASSES_KEPT)  # noqa: B019  (a setup is a few numbers)
    def parallel_passes(
        self, model: DepositionModel, speed_m_per_s: float, fineness: float = 1.0
    ) -> ParallelPasses:
        """Endlessly many of these passes at a speed [m/s]; fineness as for their collapse."""
        options: dict[str, Any] = {
            'standoff_m': self.standoff_m, 'travel_rad': self.travel_rad, 'fineness': fineness,
        }  # fmt: skip
        first = sampled_collapse(model, speed_m_per_s, **options)
        # An effect may tell forth from back, or up from down.
        if self.one_way or not (self.gun_turns or model.effects):
            return ParallelPasses.one_way(first)
        second = sampled_collapse(
            model, speed_m_per_s, backwards=True, turned=self.gun_turns, **options
        )
        difference = np.abs(second.film_um - first.film_um).max()
        if difference <= ALIKE * first.film_um.max():
            return ParallelPasses.one_way(first)
        return ParallelPasses(first, second)


def passes_to_cover(parallel: ParallelPasses, index_m: float, width_m: float) -> int:
    """Fewest passes, set evenly about the middle, that cover a width to its edges.

    Covered is where the film is at most EDGE_LOSS below the least of endlessly many passes.
    """
    period = np.linspace(0.0, parallel.period_m(index_m), 65)
    enough = (1.0 - EDGE_LOSS) * parallel.thickness_um(index_m, period).min()
    across = np.linspace(-0.5 * width_m, 0.5 * width_m, 65)
    reach = max(parallel.first.reach_m, parallel.second.reach_m)
    most = math.ceil((width_m + 2.0 * reach) / index_m) + 2
    for count in range(max(1, math.floor(width_m / index_m)), most):
        film = np.zeros(len(across))
        for collapse, line_m in _laid_evenly(parallel, index_m, count):
            film += collapse.thickness_um(across - line_m)
        if film.min() >= enough:
            return count
    return most


def variation_over_width(
    parallel: ParallelPasses, index_m: float, passes: int, width_m: float
) -> Variation:
    """Mean and sigma_n over the whole width, its edges included, of so many passes."""
    return variation(_laid_evenly(parallel, index_m, passes), -0.5 * width_m, 0.5 * width_m)


def _laid_evenly(
    parallel: ParallelPasses, index_m: float, passes: int
) -> list[tuple[Collapse, float]]:
    """Collapse and line of each pass, about the middle."""
    lines = (np.arange(passes) - 0.5 * (passes - 1)) * index_m
    return [
        (parallel.second if number % 2 else parallel.first, float(line))
        for number, line in enumerate(lines)
    ]


def cycle_time_s(
    passes: int, length_m: float, index_m: float, speed_m_per_s: float, one_way: bool
) -> float:
    """Time from the first opening of the gun to its last closing, at an even speed [s]."""
    between = math.hypot(length_m, index_m) if one_way else index_m
    return (passes * length_m + (passes - 1) * between) / speed_m_per_s
