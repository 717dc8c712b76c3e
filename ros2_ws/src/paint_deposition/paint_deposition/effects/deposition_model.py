"""The whole deposition model: planar pattern, projection, and the effects that were added."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, SerializeAsAny, model_validator

from paint_deposition.effects.base import Effect
from paint_deposition.errors import ModelError
from paint_deposition.model.eq1_pattern import Brush, PlanarPattern, listed
from paint_deposition.model.eq2_projection import Projection
from paint_deposition.motion.path_builder import DEFAULT_MAX_STEP_M
from paint_deposition.motion.trajectory import ONLY_BRUSH


class DepositionModel(BaseModel):
    """Eq. (1) projected by eq. (2), with any number of effects in the order given.

    Attributes:
        planar: the pattern of the only brush; with several it is that of the first.
        projection: eq. (2), of all brushes.
        effects: of all brushes.
        brushes: in the order of their numbers; none where the cell has no numbers.
    """

    model_config = ConfigDict(frozen=True, extra='forbid')

    planar: PlanarPattern = PlanarPattern()
    projection: Projection = Projection()
    effects: tuple[SerializeAsAny[Effect], ...] = ()
    brushes: tuple[Brush, ...] = ()

    @model_validator(mode='before')
    @classmethod
    def _in_order(cls, values: Any) -> Any:
        """With brushes in the order of their numbers, and the pattern of the first as planar."""
        if not (isinstance(values, dict) and values.get('brushes')):
            return values
        brushes = [Brush.model_validate(brush) for brush in values['brushes']]
        by_number = {brush.number: brush for brush in brushes}
        if len(by_number) < len(brushes):
            raise ValueError('two brushes have the same number; keep one')
        ordered = tuple(by_number[number] for number in sorted(by_number))
        return {**values, 'planar': ordered[0].planar, 'brushes': ordered}

    @property
    def patterns(self) -> tuple[PlanarPattern, ...]:
        """The patterns of the brushes in the order of their numbers, or the only one."""
        return tuple(brush.planar for brush in self.brushes) or (self.planar,)

    def with_patterns(self, patterns: Iterable[PlanarPattern]) -> 'DepositionModel':
        """A copy with other patterns, in the order of ``patterns``."""
        new = tuple(patterns)
        brushes = tuple(
            brush.model_copy(update={'planar': planar})
            for brush, planar in zip(self.brushes, new, strict=False)
        )
        return self.model_copy(update={'planar': new[0], 'brushes': brushes})

    def with_brush(self, number: int) -> 'DepositionModel':
        """A copy with the pattern of one brush; number 0 where there is one only.

        Raises:
            ModelError: the model does not have that brush.
        """
        if number != ONLY_BRUSH and not self.brushes:
            raise ModelError(
                f'brush {number} is not in the model: it has one pattern, planar, without a number'
            )
        return self.painting_with(number)

    def painting_with(self, number: int) -> 'DepositionModel':
        """The pattern of what a motion calls its brush: without ``brushes`` any number will do."""
        row = int(self.pattern_rows(np.array([number]))[0])
        brushes = self.brushes[row : row + 1]
        return self.model_copy(update={'planar': self.patterns[row], 'brushes': brushes})

    def of_numbers(self, numbers: Iterable[int]) -> 'DepositionModel':
        """A copy with the brushes of a motion only, or ModelError where one is not there."""
        wanted = set(numbers)
        self.require_brushes(wanted)
        if len(self.brushes) <= 1:
            return self
        kept = tuple(brush for brush in self.brushes if brush.number in wanted)
        return DepositionModel(brushes=kept, projection=self.projection, effects=self.effects)

    @property
    def brush(self) -> int:
        """Number of the first brush; 0 where the only one has none."""
        return self.brushes[0].number if self.brushes else ONLY_BRUSH

    def single(self, purpose: str) -> 'DepositionModel':
        """The model itself, or ModelError for several brushes; ``purpose`` says what needs one."""
        if len(self.brushes) > 1:
            numbers = listed(brush.number for brush in self.brushes)
            raise ModelError(
                f'{purpose} is for one brush and the model has {numbers}: say which (brush)'
            )
        return self

    def require_brushes(self, numbers: Iterable[int]) -> None:
        """Refuse by ModelError a motion that names brushes which the model does not have.

        Without ``brushes`` the pattern is that of one brush, whatever number it has in the cell.
        """
        named = set(map(int, numbers))
        if not self.brushes and len(named - {ONLY_BRUSH}) > 1:
            raise ModelError(
                f'brushes {listed(named - {ONLY_BRUSH})} are used and the model has the pattern '
                'of one, planar: give brushes, with a pattern for each number'
            )
        if self.brushes:
            self.pattern_rows(np.array(sorted(named), dtype=np.int64))

    def pattern_rows(self, numbers: np.ndarray) -> np.ndarray:
        """(M,) rows in ``patterns`` of brushes (M,) by number, or ModelError."""
        if not self.brushes:
            return np.zeros(len(numbers), dtype=np.int64)
        known = np.array([brush.number for brush in self.brushes])
        if len(known) == 1:
            numbers = np.where(numbers == ONLY_BRUSH, known[0], numbers)
        strange = np.setdiff1d(numbers, known)
        if len(strange):
            what = f'brush {strange[0]} is not in the model' if strange[0] else 'no brush is named'
            raise ModelError(f'{what}; its brushes: {listed(known)}')
        return np.searchsorted(known, numbers)

    @property
    def needs_whole_strokes(self) -> bool:
        """Whether an effect depends on what lies ahead in the stroke."""
        return any(effect.needs_whole_strokes for effect in self.effects)

    @property
    def widening(self) -> float:
        """How many times wider than the planar pattern the effects can make the spray."""
        return math.prod(effect.widening() for effect in self.effects)

    def reach_of_m(self, planar: PlanarPattern) -> float:
        """Radius on the model plane beyond which the flux of a pattern is negligible [m]."""
        # Flux below this share of the peak is left out of the film.
        return planar.radius_of_flux_m(1e-6) * self.widening

    @property
    def shadow(self) -> float:
        """Share of the flux that is stopped where the line of sight is blocked, 0 to 1."""
        return max((effect.shadow() for effect in self.effects), default=0.0)

    @property
    def max_step_m(self) -> float:
        """Travel of a sub-step that keeps the integral's error below 0.1 % of the peak [m]."""
        width = min(min(planar.sigma1_m, planar.sigma2_m) for planar in self.patterns)
        return min(DEFAULT_MAX_STEP_M, 0.1 * width)

    def effect(self, effect_id: str) -> Effect | None:
        """The effect with this id, or None."""
        return next((e for e in self.effects if e.id == effect_id), None)

    def without(self, switched_off: frozenset[str]) -> 'DepositionModel':
        """A copy in which the effects that need one of these of the cell are absent."""
        if not switched_off:
            return self
        left = tuple(e.absent if e.is_off(switched_off) else e for e in self.effects)
        return self.model_copy(update={'effects': left})

    def with_effect(self, effect: Effect) -> 'DepositionModel':
        """A copy with the effect added at the end, or in the place of the one of its id."""
        by_id = {e.id: e for e in self.effects} | {effect.id: effect}
        return self.model_copy(update={'effects': tuple(by_id.values())})
