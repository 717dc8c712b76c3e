"""How the gun is held and moved over a plane, pass after pass."""

from dataclasses import dataclass

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.pass_film import sampled_collapse
from paint_deposition.model.uniformity import ParallelPasses

# Passes that differ by less than this share of their peak are taken for the same.
ALIKE = 1e-9


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

    def raster(self, model: DepositionModel, speed_m_per_s: float) -> ParallelPasses:
        """The endless raster of these passes at a speed [m/s]."""
        options = {'standoff_m': self.standoff_m, 'travel_rad': self.travel_rad}
        first = sampled_collapse(model, speed_m_per_s, **options)
        if self.one_way:
            return ParallelPasses.one_way(first)
        if not model.effects:
            return (
                ParallelPasses(first, first.mirrored())
                if self.gun_turns
                else ParallelPasses.one_way(first)
            )
        # An effect may tell forth from back, or up from down.
        second = sampled_collapse(
            model, speed_m_per_s, backwards=True, turned=self.gun_turns, **options
        )
        difference = np.abs(second.film_um - first.film_um).max()
        if difference <= ALIKE * first.film_um.max():
            return ParallelPasses.one_way(first)
        return ParallelPasses(first, second)
