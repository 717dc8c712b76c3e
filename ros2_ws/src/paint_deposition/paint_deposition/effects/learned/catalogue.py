"""Every learned law there is, by covariate."""

from types import MappingProxyType

from paint_deposition.effects.learned.curves import CURVES
from paint_deposition.effects.learned.footprint import LearnedFootprint
from paint_deposition.effects.learned.law import LearnedLaw
from paint_deposition.effects.learned.place import LearnedMap
from paint_deposition.errors import ModelError, did_you_mean

LEARNED: MappingProxyType[str, type[LearnedLaw]] = MappingProxyType(
    {**CURVES, **{law.covariate: law for law in (LearnedMap, LearnedFootprint)}}
)


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
