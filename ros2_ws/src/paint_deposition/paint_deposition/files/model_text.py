"""The text of a model file, with a comment on every number, and of effects kept beside it."""

import ast
import inspect
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
from paint_deposition.effects.catalogue import EFFECTS, effect_of
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
    source, name = 'id', effect.id
    if effect.file:
        source, name = 'file', effect.file.as_posix()
        with suppress(ValueError):  # on another drive
            name = Path(os.path.relpath(effect.file, folder.resolve())).as_posix()
    elif needs_file(type(effect)):
        source, name = 'file', file_name(type(effect))
    text = _fields(effect, **{source: name})
    text.yaml_add_eol_comment(effect.family, source, COMMENT_COLUMN)
    return text


def _fields(values: BaseModel, **before: str) -> CommentedMap:
    text = CommentedMap({**before, **plain(values.model_dump())})
    for name, info in type(values).model_fields.items():
        if info.description and name in text:
            text.yaml_add_eol_comment(info.description, name, COMMENT_COLUMN)
    return text


def needs_file(effect: type[Effect]) -> bool:
    """Whether it is a user's own class, from a script or a notebook."""
    known = issubclass(effect, LearnedLaw) or effect.file is not None
    return not known and effect.id not in EFFECTS


def file_name(effect: type[Effect]) -> str:
    """What its file beside a model is called."""
    return f'{effect.id}.py'


def source_of(effect: type[Effect]) -> str:
    """The class with the imports, functions and constants that it uses, as a file of its own.

    Raises:
        ModelError: its source is not known, or is no effect by itself.
    """
    remedy = f'put {effect.__name__} in a file of its own and load that with load_effect_file'
    try:
        text = _source(effect)
        effect_of(Path(file_name(effect)), text.encode())
    except (OSError, TypeError, SyntaxError):
        raise ModelError(f'the source of effect {effect.id!r} is not known: {remedy}') from None
    except ModelError as error:
        raise ModelError(f'{error}; {remedy}') from None
    return text


def _source(cls: type[Effect]) -> str:
    own = inspect.getsource(cls)
    text = inspect.getsource(inspect.getmodule(cls) or cls)
    wanted, kept = _names(ast.parse(own)), [own]
    # A function may use constants that stand above it.
    for node in reversed(ast.parse(text).body):
        made = {node.name} if isinstance(node, ast.FunctionDef) else set[str]()
        if isinstance(node, ast.Assign):
            made = made.union(*map(_names, node.targets))
        if isinstance(node, ast.Import | ast.ImportFrom) or wanted & made:
            kept.append(ast.get_source_segment(text, node) or '')
            wanted |= _names(node)
    return '\n\n'.join(reversed(kept))


def _names(tree: ast.AST) -> set[str]:
    return {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
