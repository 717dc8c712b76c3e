"""The text of a model file, with a comment on every number."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from pydantic import BaseModel

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel

COMMENT_COLUMN = 33
SECTION_COMMENTS = {
    'planar': 'eq. (1): flux on the model plane',
    'projection': 'eq. (2): from the model plane to the surface',
}
EXTRA_COMMENTS = {
    'uncertainty': 'standard deviations',
    'history': 'what was added, oldest first',
}


def model_text(
    model: DepositionModel,
    folder: Path,
    header_comment: str,
    name: str,
    extras: Mapping[str, Any],
) -> str:
    """YAML of a model.

    Args:
        model: what to write.
        folder: where the file will be; users' own effects are named relative to it.
        header_comment: lines for the top.
        name: what the user calls the model.
        extras: plain values by top-level key, left out where empty.
    """
    lines = [f'# {line}'.rstrip() for line in header_comment.splitlines()]
    if name:
        lines.append(f'name: {_plain_yaml(name)}')
    for key, comment in SECTION_COMMENTS.items():
        lines += [_commented(f'{key}:', comment), *_fields(getattr(model, key), '  ')]
    lines += _effects(model.effects, folder)
    for key, value in extras.items():
        if value:
            lines += [_commented(f'{key}:', EXTRA_COMMENTS[key]), _block(value)]
    return '\n'.join(lines) + '\n'


def _effects(effects: tuple[Effect, ...], folder: Path) -> list[str]:
    if not effects:
        return ['effects: []']
    lines = ['effects:']
    for effect in effects:
        source = f'id: {effect.id}'
        if effect.file is not None:
            source = f'file: {_plain_yaml(_relative(effect.file, folder))}'
        lines += [_commented(f'  - {source}', effect.family), *_fields(effect, '    ')]
    return lines


def _relative(file: Path, folder: Path) -> str:
    try:
        return Path(os.path.relpath(file, folder.resolve())).as_posix()
    except ValueError:  # another drive
        return file.as_posix()


def _fields(values: BaseModel, indent: str) -> list[str]:
    return [
        _commented(f'{indent}{name}: {_plain_yaml(getattr(values, name))}', info.description)
        for name, info in type(values).model_fields.items()
    ]


def _commented(text: str, comment: str | None) -> str:
    return f'{text:<{COMMENT_COLUMN}} # {comment}' if comment else text


def _plain_yaml(value: Any) -> str:
    """A scalar that reads back as exactly this value."""
    return yaml.safe_dump(_plain(value), width=10_000, allow_unicode=True).split('\n')[0]


def _block(value: Any) -> str:
    text = yaml.safe_dump(_plain(value), sort_keys=False, allow_unicode=True, width=99)
    return '\n'.join(f'  {line}' for line in text.splitlines())


def _plain(value: Any) -> Any:
    """Numbers and containers of Python for those of NumPy."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        return value.item()
    return value
