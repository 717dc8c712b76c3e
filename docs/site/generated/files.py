"""The keys of the files that people write, from the models that check them.

``python -m generated.files`` in docs/site writes them into docs/files.md, as `make docs` does.
"""

import re
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from generated.markdown import table
from paint_deposition.batch.sweep_file import Passes, Sample, SweepFile
from paint_deposition.files import campaign_coats, campaign_file, model_file
from paint_deposition.files.motion_source import MotionSource, OnePart
from paint_deposition.files.tables.gauge_formats import (
    ALIASES,
    FOLDERS,
    FORMATS,
    LAYERS,
    LINES,
    OWN,
)
from paint_deposition.files.zones_file import ZoneEntry
from paint_deposition.model.eq1_pattern import PlanarPattern, SetPoints

MOTION = set(MotionSource.model_fields)
PART = set(OnePart.model_fields)
BEGIN, END = '<!-- generated: files -->', '<!-- end of generated -->'
MODEL = """
A model has `planar` or `brushes` by their numbers, `projection`, a list of
[`effects`](effects.md), and a `name`; a fit adds `uncertainty`, `history` and `posterior`.
"""


def text() -> str:
    """A section for each file."""
    own = ', '.join(f'`{name}`' for name in OWN.values())
    aliases = [(f'`{name}`', ', '.join(words)) for name, words in ALIASES.items()]
    return '\n'.join([
        '## Model\n',
        MODEL,
        '### `planar`\n', _keys(PlanarPattern),
        '### `projection`\n', _keys(model_file.ProjectionSection),
        '### A brush of `brushes`\n', 'Also `planar`.\n', _keys(SetPoints),
        '## Campaign\n', _keys(campaign_file._File),
        '### An experiment of `experiments`\n',
        'Also the keys of [a motion](#a-motion) and of [a part](#a-part).\n',
        _keys(campaign_file._Entry, without=MOTION | PART),
        '### A coat of `coats`\n', 'Also the keys of [a motion](#a-motion).\n',
        _keys(campaign_coats.CoatEntry, without=MOTION),
        '## Zones\n', 'Each of the list `zones`, see [zones](zones.md).\n', _keys(ZoneEntry),
        '## A motion\n', 'How a recording is read; for commands the same as options.\n',
        _keys(MotionSource),
        '## A part\n', _keys(OnePart),
        '## Gauge readings\n', f'Own columns: {own}. Other headings, without accents:\n',
        table(('column', 'headings'), aliases),
        'Side by side, layers: ' + '; '.join(f'`{n}` {", ".join(w)}' for n, w in LAYERS.items()),
        '\nLayouts known by their headings, `#` a number:\n',
        table(('layout', 'known by', 'columns', 'no reading unless'), _layouts()),
        '## Sweep\n', 'Also the keys of [a motion](#a-motion).\n',
        _keys(SweepFile, without=MOTION),
        '### `passes`\n', _keys(Passes), '### `sample`\n', _keys(Sample),
    ])  # fmt: skip


def written(page: str) -> str:
    """The page docs/files.md with what it says of the code."""
    made = text().replace('\n\n\n', '\n\n').strip()
    return re.sub(f'({BEGIN}\n).*?(\n{END})', lambda found: found[1] + made + found[2], page,
                  flags=re.DOTALL)  # fmt: skip


def _layouts() -> list[tuple[str, str, str, str]]:
    rows = [
        (
            one.name, ', '.join(one.shown_by),
            ', '.join(f'{quantity}: {heading}' for quantity, heading in one.columns.items()),
            ', '.join(f'{heading} is {good[1]}' for heading, good in one.status.items()),
        )
        for one in FORMATS
    ]  # fmt: skip
    rows += [(n, 'its lines', ', '.join(line.groupindex), '') for n, line in LINES.items()]
    return rows + [(f'{n}, folder or zip', ', '.join(f), '', '') for n, f in FOLDERS.items()]


def _keys(model: type[BaseModel], without: set[str] = frozenset()) -> str:
    schema = model.model_json_schema()
    rows = [
        (f'`{key}`', said.get('description', 'text'), _bounds(said), _default(said, key, schema))
        for key, said in schema['properties'].items()
        if key not in without
    ]
    return table(('key', 'meaning', 'range', 'default'), rows)


def _bounds(said: dict[str, Any]) -> str:
    """The range of a number, whether or not it may be left out."""
    for kind in (said, *said.get('anyOf', ())):
        low, above = kind.get('minimum'), kind.get('exclusiveMinimum')
        high = kind.get('maximum')
        if above is not None:
            return f'above {above:g}' if high is None else f'above {above:g} to {high:g}'
        if low is not None:
            return f'{low:g} or more' if high is None else f'{low:g} to {high:g}'
    return ''


def _default(said: dict[str, Any], key: str, schema: dict[str, Any]) -> str:
    if key in schema.get('required', ()):
        return 'required'
    value = said.get('default')
    if isinstance(value, bool):
        return f'`{value}`'.lower()
    shown = value not in (None, '', [], {}) and not isinstance(value, dict)
    return f'`{value}`' if shown else ''


if __name__ == '__main__':
    page = Path(__file__).resolve().parents[2] / 'files.md'
    page.write_text(written(page.read_text(encoding='utf-8')), encoding='utf-8')
