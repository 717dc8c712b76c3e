"""The keys of the files that people write, from the models that check them.

``python -m generated.files`` in docs/site writes them into docs/files.md, as `make docs` does.
"""

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from generated.markdown import table
from paint_deposition.batch.sweep_file import Passes, Sample, SweepFile
from paint_deposition.files import campaign_coats, campaign_file, model_file
from paint_deposition.files.tables.gauge_formats import (
    ALIASES,
    FOLDERS,
    FORMATS,
    LAYERS,
    LINES,
    OWN,
)
from paint_deposition.files.zones_file import ZoneEntry
from paint_deposition.model.eq1_pattern import BrushEntry, PlanarPattern
from paint_deposition.request import MotionOptions, OnePart, range_end

MOTION = set(MotionOptions.model_fields)
PART = set(OnePart.model_fields)
# Keys that were explained before, in the order of the file.
TARGET = ['target_um', 'tolerance_um']
COAT = [key for key in campaign_coats.PaintJob.model_fields if key not in MOTION]
BEGIN, END = '<!-- generated: files -->', '<!-- end of generated -->'
MODEL = """
A model has `planar` or `brushes` by their numbers, `projection`, a list of
[`effects`](effects.md), and a `name`; a fit adds `uncertainty`, `history` and `posterior`.
"""


def text() -> str:
    """A section for each file."""
    own = ', '.join(f'`{name}`' for name in OWN.values())
    layouts = dict.fromkeys([*(one.name for one in FORMATS), *LINES, *FOLDERS])
    aliases = [(f'`{name}`', ', '.join(words)) for name, words in ALIASES.items()]
    return '\n'.join([
        '## Model\n',
        MODEL,
        '### `planar`\n', _keys(PlanarPattern),
        '### `projection`\n', _keys(model_file.ProjectionSection),
        '### A brush of `brushes`\n', _keys(BrushEntry),
        '## Campaign\n', _keys(campaign_file._File),
        '### An experiment of `experiments`\n',
        f'Also the keys of [a motion](#a-motion) and of [a part](#a-part), {_listed(TARGET)}.\n',
        _keys(campaign_file._Entry, without=MOTION.union(PART, TARGET)),
        '### A coat of `coats`\n',
        f'The keys of [a motion](#a-motion), and of an experiment {_listed(COAT)}.\n',
        '## Zones\n', 'Each of the list `zones`, see [zones](zones.md).\n', _keys(ZoneEntry),
        '## A motion\n', 'How a recording is read; for commands the same as options.\n',
        _keys(MotionOptions),
        '## A part\n', _keys(OnePart),
        '## Gauge readings\n', f'Own columns: {own}. Other headings, without accents:\n',
        table(('column', 'headings'), aliases),
        'Side by side, layers: ' + '; '.join(f'`{n}` {", ".join(w)}' for n, w in LAYERS.items()),
        f'\nLayouts known by their headings or lines: {"; ".join(layouts)}.\n',
        '## Sweep\n',
        'Also the keys of [a motion](#a-motion) and of [a part](#a-part).\n',
        _keys(SweepFile, without=MOTION.union(PART)),
        '### `passes`\n', _keys(Passes), '### `sample`\n', _keys(Sample),
    ])  # fmt: skip


def written(page: str) -> str:
    """The page docs/files.md with what it says of the code."""
    made = text().replace('\n\n\n', '\n\n').strip()
    return re.sub(f'({BEGIN}\n).*?(\n{END})', lambda found: found[1] + made + found[2], page,
                  flags=re.DOTALL)  # fmt: skip


def _keys(model: type[BaseModel], without: set[str] = frozenset()) -> str:
    """A table of keys; those of one meaning share a row."""
    schema = model.model_json_schema()
    rows: dict[str, list[str]] = {}
    for key, said in schema['properties'].items():
        if key not in without:
            meaning, bounds = said.get('description', 'text'), _bounds(said)
            told = all(word in meaning for word in bounds.split(', '))
            facts = meaning.rstrip('.'), '' if told else bounds, _default(said, key, schema)
            rows.setdefault('; '.join(filter(None, facts)), []).append(f'`{key}`')
    return table(('key', 'meaning'), [(', '.join(keys), said) for said, keys in rows.items()])


def _listed(keys: Iterable[str]) -> str:
    return ', '.join(f'`{key}`' for key in keys)


def _bounds(said: dict[str, Any]) -> str:
    """The range of a number, whether or not it may be left out."""
    for kind in (said, *said.get('anyOf', ())):
        if 'enum' in kind:
            return ', '.join(kind['enum'])
        low, above = kind.get('minimum'), kind.get('exclusiveMinimum')
        high = kind.get('maximum')
        if above is not None:
            return f'above {range_end(above)}' + ('' if high is None else f' to {range_end(high)}')
        if low is not None:
            return range_end(low) + (' or more' if high is None else f' to {range_end(high)}')
    return ''


def _default(said: dict[str, Any], key: str, schema: dict[str, Any]) -> str:
    if key in schema.get('required', ()):
        return 'required'
    value = said.get('default')
    if isinstance(value, bool):
        return f'default `{value}`'.lower()
    shown = value not in (None, '', [], {}) and not isinstance(value, dict)
    return f'default `{value}`' if shown else ''


if __name__ == '__main__':
    page = Path(__file__).resolve().parents[2] / 'files.md'
    page.write_text(written(page.read_text(encoding='utf-8')), encoding='utf-8')
