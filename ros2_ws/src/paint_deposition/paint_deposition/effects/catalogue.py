"""Every effect and every learned law that the project knows."""

import importlib
import pkgutil
from collections.abc import Mapping
from types import MappingProxyType

from paint_deposition.effects import library
from paint_deposition.effects.base import Effect
from paint_deposition.effects.learned.curves import CURVES
from paint_deposition.effects.learned.footprint import LearnedFootprint
from paint_deposition.effects.learned.law import LearnedLaw
from paint_deposition.effects.learned.place import LearnedMap
from paint_deposition.errors import ModelError, did_you_mean

# In the order in which people look for causes.
FAMILIES = (
    'incidence', 'curvature', 'boundary', 'standoff', 'lateral shift', 'order', 'level', 'time',
    'visibility',
)  # fmt: skip


def _of_the_library(name: str) -> type[Effect]:
    module = importlib.import_module(f'{library.__name__}.{name}')
    (effect,) = (c for c in Effect.__subclasses__() if c.__module__ == module.__name__)
    return effect


# Effect classes by id, family by family: one a file of the library.
EFFECTS: Mapping[str, type[Effect]] = MappingProxyType(
    {
        effect.id: effect
        for effect in sorted(
            (_of_the_library(module.name) for module in pkgutil.iter_modules(library.__path__)),
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
