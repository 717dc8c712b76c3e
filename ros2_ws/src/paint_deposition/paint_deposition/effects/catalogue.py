"""Every effect that the project knows."""

import importlib
import pkgutil
from types import MappingProxyType

from paint_deposition.effects import library
from paint_deposition.effects.base import Effect
from paint_deposition.errors import ModelError, did_you_mean

# In the order in which people look for causes.
FAMILIES = (
    'incidence', 'curvature', 'boundary', 'standoff', 'lateral shift', 'order', 'level', 'time',
    'visibility',
)  # fmt: skip


def _effects_of_the_library() -> dict[str, type[Effect]]:
    for module in pkgutil.iter_modules(library.__path__, f'{library.__name__}.'):
        importlib.import_module(module.name)
    own = [c for c in Effect.__subclasses__() if c.__module__.startswith(library.__name__)]
    own.sort(key=lambda effect: (FAMILIES.index(effect.family), effect.id))
    return {effect.id: effect for effect in own}


# Effect classes by id.
EFFECTS = MappingProxyType(_effects_of_the_library())


def effect_class(effect_id: str) -> type[Effect]:
    """The class of an effect of the library, or of a learned law, as 'learned:time_s'.

    Raises:
        ModelError: there is none of that id; names the nearest.
    """
    if effect_id in EFFECTS:
        return EFFECTS[effect_id]
    family, is_learned, covariate = effect_id.partition(':')
    if is_learned and family == 'learned':
        from paint_deposition.effects.learned.catalogue import learned_law

        return learned_law(covariate)
    raise ModelError(f'no effect is called {effect_id!r}; {did_you_mean(effect_id, EFFECTS)}')
