"""docs/effects.md says of every effect what its class says."""

import re
from pathlib import Path

import pytest

from booth import SAMPLES
from paint_deposition.effects.base import Effect
from paint_deposition.effects.catalogue import EFFECTS, FAMILIES
from paint_deposition.kernel.laws import Ray


@pytest.fixture(scope='module')
def rows(repository: Path) -> dict[str, list[list[str]]]:
    """Rows of the tables by effect, the cells that continue an effect with its id filled in."""
    by_id: dict[str, list[list[str]]] = {}
    effect_id = ''
    for line in (repository / 'docs/effects.md').read_text(encoding='utf-8').splitlines():
        cells = [cell.strip().replace('−', '-') for cell in line.split('|')[1:-1]]
        if len(cells) != 9 or not re.fullmatch('`[a-z_]+`|', cells[0]):
            continue
        effect_id = cells[0].strip('`') or effect_id
        by_id.setdefault(effect_id, []).append(cells)
    return by_id


def test_every_effect_is_there_in_the_order_of_the_families(rows):
    assert list(rows) == list(EFFECTS)
    assert set(rows) == set(EFFECTS)


def test_the_headings_are_the_families(repository: Path):
    text = (repository / 'docs/effects.md').read_text(encoding='utf-8')
    headings = [heading.lower() for heading in re.findall(r'^## (.*)$', text, re.MULTILINE)]
    assert headings[: len(FAMILIES)] == list(FAMILIES)


@pytest.mark.parametrize('effect', EFFECTS.values(), ids=lambda effect: effect.id)
def test_the_table_is_that_of_the_class(effect: type[Effect], rows):
    first = rows[effect.id][0]
    assert first[7] == effect.signature
    assert tuple(re.findall('`([a-z_]+)`', first[8])) == effect.rivals
    documented = {row[3].strip('`'): row[4:7] for row in rows[effect.id]}
    expected = {}
    for name, at in effect.parameters().items():
        size = at['typical'] if at['role'] == 'amplitude' else at['neutral']
        shown = f'{size:g}' if at['role'] == 'amplitude' else f'shape, {size:g}'
        expected[name] = [at['unit'], f'{at["low"]:g} to {at["high"]:g}', shown]
    assert documented == expected


def test_how_to_write_ones_own_names_what_there_is(repository: Path):
    text = (repository / 'docs/effects.md').read_text(encoding='utf-8')
    assert (SAMPLES / 'my_effect.py').relative_to(repository).as_posix() in text
    for name in Ray._fields:
        assert f'`{name}`' in text
    for place in ('flux_factor', 'pattern_scale', 'on_path', 'on_film', 'on_gauge'):
        assert f'`{place}(' in text
        assert hasattr(Effect, place)
