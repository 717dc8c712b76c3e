"""Every effect that the project knows."""

import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache
from types import MappingProxyType
from typing import Any

from paint_deposition.effects import library
from paint_deposition.effects.base import Effect
from paint_deposition.errors import ModelError, did_you_mean

# In the order in which people look for causes.
FAMILIES = (
    'incidence', 'curvature', 'boundary', 'standoff', 'lateral shift', 'order', 'level', 'time',
    'visibility',
)  # fmt: skip
# Of the effects in the library: the names of their files.
IDS = tuple(module.name for module in pkgutil.iter_modules(library.__path__))

# Effect classes by id, family by family. All are loaded when this is first asked for: who paints
# needs those of the model only.
EFFECTS: Mapping[str, type[Effect]]


def __getattr__(name: str) -> Any:
    if name == 'EFFECTS':
        return _whole_library()
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')


@cache
def _whole_library() -> Mapping[str, type[Effect]]:
    effects = [effect_class(effect_id) for effect_id in IDS]
    effects.sort(key=lambda effect: (FAMILIES.index(effect.family), effect.id))
    return MappingProxyType({effect.id: effect for effect in effects})


def effect_class(effect_id: str) -> type[Effect]:
    """The class of an effect of the library, or of a learned law, as 'learned:time_s'.

    Raises:
        ModelError: there is none of that id; names the nearest.
    """
    if effect_id in IDS:
        module = importlib.import_module(f'{library.__name__}.{effect_id}')
        (effect,) = (c for c in Effect.__subclasses__() if c.__module__ == module.__name__)
        return effect
    family, is_learned, covariate = effect_id.partition(':')
    if is_learned and family == 'learned':
        from paint_deposition.effects.learned.catalogue import learned_law

        return learned_law(covariate)
    remedy = did_you_mean(effect_id, _whole_library())
    raise ModelError(f'no effect is called {effect_id!r}; {remedy}')
