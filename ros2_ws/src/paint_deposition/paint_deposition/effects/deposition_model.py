"""The whole deposition model: planar pattern, projection, and the effects that were added."""

import math

from pydantic import BaseModel, ConfigDict, SerializeAsAny

from paint_deposition.effects.base import Effect
from paint_deposition.model.pattern import PlanarPattern
from paint_deposition.model.projection import Projection
from paint_deposition.motion.path_builder import DEFAULT_MAX_STEP_M

# Flux below this share of the peak is left out of the film.
CUT_FLUX = 1e-6


class DepositionModel(BaseModel):
    """Eq. (1) projected by eq. (2), with any number of effects in the order given."""

    model_config = ConfigDict(frozen=True, extra='forbid')

    planar: PlanarPattern = PlanarPattern()
    projection: Projection = Projection()
    effects: tuple[SerializeAsAny[Effect], ...] = ()

    @property
    def needs_whole_strokes(self) -> bool:
        """Whether an effect depends on what lies ahead in the stroke."""
        return any(effect.needs_whole_strokes for effect in self.effects)

    @property
    def widening(self) -> float:
        """How many times wider than the planar pattern the effects can make the spray."""
        return math.prod(effect.reach() for effect in self.effects)

    @property
    def reach_m(self) -> float:
        """Radius on the model plane beyond which the flux is negligible [m]."""
        return self.planar.radius_of_flux_m(CUT_FLUX) * self.widening

    @property
    def shadow(self) -> float:
        """Share of the flux that is stopped where the line of sight is blocked, 0 to 1."""
        return max((effect.shadow() for effect in self.effects), default=0.0)

    @property
    def max_step_m(self) -> float:
        """Travel of a sub-step that keeps the integral's error below 0.1 % of the peak [m]."""
        width = min(self.planar.sigma1_m, self.planar.sigma2_m)
        return min(DEFAULT_MAX_STEP_M, 0.1 * width)

    def effect(self, effect_id: str) -> Effect | None:
        """The effect with this id, or None."""
        return next((e for e in self.effects if e.id == effect_id), None)

    def without(self, switched_off: frozenset[str]) -> 'DepositionModel':
        """A copy in which the effects that need one of these of the cell are absent."""
        if not switched_off:
            return self
        left = tuple(e.absent if e.needs in switched_off else e for e in self.effects)
        return self.model_copy(update={'effects': left})

    def with_effect(self, effect: Effect) -> 'DepositionModel':
        """A copy with the effect added, or replaced where one of its id is there."""
        others = tuple(e for e in self.effects if e.id != effect.id)
        return self.model_copy(update={'effects': (*others, effect)})
