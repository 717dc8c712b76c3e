"""The text of a model file, with a comment on every number."""

import os
from collections.abc import Mapping
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap

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
    text = CommentedMap({'name': name} if name else {})
    if header_comment:
        text.yaml_set_start_comment(header_comment)
    for key, comment in SECTION_COMMENTS.items():
        text[key] = _fields(getattr(model, key))
        _comment(text, key, comment)
    text['effects'] = [_effect(effect, folder) for effect in model.effects]
    for key, value in extras.items():
        if value:
            text[key] = _plain(value)
            _comment(text, key, EXTRA_COMMENTS[key])
    stream = StringIO()
    writer = YAML()
    writer.width = 10_000
    writer.indent(sequence=4, offset=2)
    writer.dump(text, stream)
    return stream.getvalue()


def _effect(effect: Effect, folder: Path) -> CommentedMap:
    source = {'id': effect.id}
    if effect.file is not None:
        source = {'file': _relative(effect.file, folder)}
    text = _fields(effect, source)
    _comment(text, next(iter(source)), effect.family)
    return text


def _fields(values: BaseModel, before: Mapping[str, str] | None = None) -> CommentedMap:
    text = CommentedMap({**(before or {}), **_plain(dict(values))})
    for name, info in type(values).model_fields.items():
        _comment(text, name, info.description)
    return text


def _comment(text: CommentedMap, key: str, comment: str | None) -> None:
    if comment:
        text.yaml_add_eol_comment(comment, key, COMMENT_COLUMN)


def _relative(file: Path, folder: Path) -> str:
    try:
        return Path(os.path.relpath(file, folder.resolve())).as_posix()
    except ValueError:  # another drive
        return file.as_posix()


def _plain(value: Any) -> Any:
    """Numbers and containers of Python for those of NumPy."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        return value.item()
    return value
