"""The text of a model file, with a comment on every number."""

import os
from collections.abc import Mapping
from contextlib import suppress
from io import StringIO
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq

from paint_deposition.effects.base import Effect
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.learned.law import LearnedLaw
from paint_deposition.errors import ModelError
from paint_deposition.files.atomic import plain
from paint_deposition.model.eq1_pattern import Brush, SetPoints

COMMENT_COLUMN = 33
# What stands for all learned laws; the covariate says which.
LEARNED_ID = 'learned'
COMMENTS = {
    'planar': 'eq. (1): flux on the model plane',
    'brushes': 'eq. (1) and set-points by number',
    'projection': 'eq. (2): from the model plane to the surface',
    'uncertainty': 'standard deviations',
    'posterior': 'posterior of the fit: the prior of the next job',
    'history': 'what was added, oldest first',
}


def model_text(
    model: DepositionModel, folder: Path, header_comment: str, name: str, extras: Mapping[str, Any]
) -> str:
    """YAML of a model for a file in ``folder``, to which users' own effects are named relative.

    ``extras`` are plain values by top-level key, left out where empty.
    """
    text = CommentedMap({'name': name} if name else {})
    if header_comment:
        # Names may hold what ends a line for YAML, and what it does not take.
        lines = (''.join(filter(str.isprintable, line)) for line in header_comment.splitlines())
        text.yaml_set_start_comment('\n'.join(lines))
    if model.brushes:
        text['brushes'] = CommentedMap({brush.number: _brush(brush) for brush in model.brushes})
    else:
        text['planar'] = _fields(model.planar)
    text['projection'] = _fields(model.projection)
    text['effects'] = [_effect(effect, folder) for effect in model.effects]
    text |= {key: _with_rows(plain(value)) for key, value in extras.items() if value}
    for key, comment in COMMENTS.items():
        if key in text:
            text.yaml_add_eol_comment(comment, key, COMMENT_COLUMN)
    stream = StringIO()
    writer = YAML()
    writer.width = 10_000
    writer.indent(sequence=4, offset=2)
    writer.dump(text, stream)
    return stream.getvalue()


def _brush(brush: Brush) -> CommentedMap:
    text = CommentedMap({'planar': _fields(brush.planar)})
    known = brush.set_points.model_dump(exclude_none=True)
    text |= {key: value for key, value in _fields(brush.set_points).items() if key in known}
    for key in known:
        description = SetPoints.model_fields[key].description
        text.yaml_add_eol_comment(description, key, COMMENT_COLUMN)
    return text


def _with_rows(value: Any) -> Any:
    """The same with lists of plain values on one line each."""
    if isinstance(value, dict):
        return {key: _with_rows(inner) for key, inner in value.items()}
    if isinstance(value, list) and not any(isinstance(inner, dict) for inner in value):
        row = CommentedSeq(value)
        row.fa.set_flow_style()
        return row
    return value


def _effect(effect: Effect, folder: Path) -> CommentedMap:
    if isinstance(effect, LearnedLaw):
        text = _fields(effect, id=LEARNED_ID, covariate=effect.covariate)
        if not text.get('sd'):
            text.pop('sd', None)
        for name in {'learned', 'sd'} & text.keys():
            text[name] = _with_rows(text[name])
        about = f'{effect.over} [{effect.unit}]'
        text.yaml_add_eol_comment(about, 'covariate', COMMENT_COLUMN)
        return text
    require_file(type(effect))
    source, name = 'id', effect.id
    if effect.file:
        source, name = 'file', effect.file.as_posix()
        with suppress(ValueError):  # on another drive
            name = Path(os.path.relpath(effect.file, folder.resolve())).as_posix()
    text = _fields(effect, **{source: name})
    text.yaml_add_eol_comment(effect.family, source, COMMENT_COLUMN)
    return text


def _fields(values: BaseModel, **before: str) -> CommentedMap:
    text = CommentedMap({**before, **plain(values.model_dump())})
    for name, info in type(values).model_fields.items():
        if info.description and name in text:
            text.yaml_add_eol_comment(info.description, name, COMMENT_COLUMN)
    return text


def require_file(effect: type[Effect]) -> None:
    """Refuse a user's own class of a script or a notebook: a model names the file of it."""
    known = issubclass(effect, LearnedLaw) or effect.file is not None or effect.id in EFFECTS
    if not known:
        raise ModelError(
            f'effect {effect.id!r} has no file; put {effect.__name__} in a file of its own and '
            'load that with load_effect_file'
        )
