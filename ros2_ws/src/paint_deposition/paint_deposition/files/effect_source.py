"""The source of a user's effect that was not read from a file of its own: kept beside a model."""

import ast
import inspect
from pathlib import Path

from paint_deposition.effects.base import Effect
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.effects.learned.law import LearnedLaw
from paint_deposition.effects.user_effects import effect_of
from paint_deposition.errors import ModelError


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
