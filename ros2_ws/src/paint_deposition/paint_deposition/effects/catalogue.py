"""Every effect of the library, and every learned law."""

import importlib
import pkgutil
from collections.abc import Mapping
from types import MappingProxyType

from paint_deposition.effects import library
from paint_deposition.effects.base import Effect
from paint_deposition.effects.learned_curves import CURVES
from paint_deposition.effects.learned_laws import LearnedFootprint, LearnedLaw, LearnedMap
from paint_deposition.errors import ModelError, did_you_mean

# In the order in which people look for causes.
FAMILIES = (
    'incidence', 'curvature', 'boundary', 'standoff', 'lateral shift', 'order', 'level', 'time',
    'visibility',
)  # fmt: skip


# Effect classes by id, family by family: one a file of the library.
for module in pkgutil.iter_modules(library.__path__, f'{library.__name__}.'):
    importlib.import_module(module.name)
EFFECTS: Mapping[str, type[Effect]] = MappingProxyType(
    {
        effect.id: effect
        for effect in sorted(
            (c for c in Effect.__subclasses__() if c.__module__.startswith(library.__name__)),
            key=lambda effect: (FAMILIES.index(effect.family), effect.id),
        )
    }
)
# Learned laws by covariate.
LEARNED: Mapping[str, type[LearnedLaw]] = MappingProxyType(
    {**CURVES, LearnedMap.covariate: LearnedMap, LearnedFootprint.covariate: LearnedFootprint}
)


def effect_class(effect_id: str) -> type[Effect]:
    """The class of an effect of the library, or of a learned law, as 'learned:time_s'.

    Raises:
        ModelError: there is none of that id; names the nearest.
    """
    family, is_learned, covariate = effect_id.partition(':')
    if is_learned and family == 'learned':
        return learned_law(covariate)
    if effect_id in EFFECTS:
        return EFFECTS[effect_id]
    raise ModelError(f'no effect is called {effect_id!r}; {did_you_mean(effect_id, EFFECTS)}')


def learned_law(covariate: str) -> type[LearnedLaw]:
    """The class of the learned law over a covariate.

    Raises:
        ModelError: there is none over it; names the nearest.
    """
    if covariate in LEARNED:
        return LEARNED[covariate]
    raise ModelError(
        f'no learned law has the covariate {covariate!r}; {did_you_mean(covariate, LEARNED)}'
    )
