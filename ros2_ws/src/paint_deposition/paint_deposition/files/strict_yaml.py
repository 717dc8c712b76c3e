"""YAML in which a key may not be given twice."""

from pathlib import Path
from typing import Any

import yaml

from paint_deposition.errors import PaintError


class _StrictLoader(yaml.SafeLoader):
    """PyYAML keeps the last of two equal keys and says nothing."""


def _mapping(loader: _StrictLoader, node: yaml.MappingNode) -> dict[Any, Any]:
    seen: dict[Any, Any] = {}
    for key_node, value_node in node.value:
        key = loader.construct_object(key_node, deep=True)
        if not isinstance(key, str | int | float | bool | None):
            raise yaml.constructor.ConstructorError(
                None, None, 'a key that is no text', key_node.start_mark
            )
        if key in seen:
            raise yaml.constructor.ConstructorError(
                None, None, f'{key!r} is given twice', key_node.start_mark
            )
        seen[key] = loader.construct_object(value_node, deep=True)
    return seen


_StrictLoader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _mapping)


def read_yaml(path: Path, kind: str, refusal: type[PaintError]) -> Any:
    """The one document of a file.

    Args:
        path: of the file.
        kind: what it should be, for the remedy.
        refusal: error to raise.

    Raises:
        PaintError: of the class given; the file is not there, cannot be read, is no YAML, or gives
            a key twice.
    """
    try:
        return yaml.load(path.read_text(encoding='utf-8'), _StrictLoader)
    except FileNotFoundError:
        raise refusal(f'{path}: no such file; give a {kind} YAML') from None
    except OSError as error:
        raise refusal(f'{path}: cannot be read ({error.strerror})') from None
    except (UnicodeDecodeError, yaml.YAMLError) as error:
        raise refusal(f'{path}: cannot be read as YAML ({_problem(error)})') from None


def _problem(error: Exception) -> str:
    """Where and what is wrong, in one line."""
    mark = getattr(error, 'problem_mark', None)
    if mark is None:
        return ' '.join(str(error).split())
    return f'line {mark.line + 1}: {getattr(error, "problem", error)}'
