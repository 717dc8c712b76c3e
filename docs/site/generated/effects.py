"""The effects of the library and the covariates of learned laws, from their classes."""

from inspect import cleandoc

from generated.markdown import prose, table
from paint_deposition.effects.base import Effect
from paint_deposition.effects.catalogue import EFFECTS, FAMILIES
from paint_deposition.effects.learned_curves import CURVES


def text() -> str:
    """A section for each family, in the order in which people look for causes."""
    rows = [(f'[`{effect.id}`](#{effect.id})', effect.signature) for effect in EFFECTS.values()]
    parts = [table(('effect', 'where it shows'), rows)]
    for family in FAMILIES:
        members = [effect for effect in EFFECTS.values() if effect.family == family]
        parts += [f'## {family.capitalize()}\n', *map(_section, members)]
    return '\n'.join(parts)


def covariates() -> str:
    """What a curve may be learned over."""
    rows = [
        (f'`{law.covariate}`', law.unit, law.over, _acts_on(law), ', '.join(law.kinds))
        for law in CURVES.values()
    ]
    return table(('covariate', 'unit', 'what it is', 'acts on', 'kinds'), rows)


def _acts_on(law: type[Effect]) -> str:
    if law.flux_factor is not None:
        return 'flux'
    return 'film' if law.on_path is Effect.on_path else 'flow'


def _section(effect: type[Effect]) -> str:
    rows = [
        (
            f'`{name}`', _what(effect, name), f'{at["low"]:g} to {at["high"]:g}', at['unit'],
            f'{at["typical"]:g}' if at['role'] == 'amplitude' else f'default {at["neutral"]:g}',
        )
        for name, at in effect.parameters().items()
    ]  # fmt: skip
    rivals = ', '.join(f'[`{rival}`](#{rival})' for rival in effect.rivals)
    return '\n'.join([
        f'### {effect.id}\n',
        prose(cleandoc(effect.__doc__ or '')),
        '',
        *([f'* **Easily taken for:** {rivals}'] if rivals else []),
        f'* **Source:** {effect.source}\n',
        table(('parameter', 'meaning', 'bounds', 'unit', 'typical'), rows),
    ])  # fmt: skip


def _what(effect: type[Effect], name: str) -> str:
    return effect.model_fields[name].description.rpartition(' [')[0]
