"""YAML 1.2 in which a key may not be given twice."""

import re
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError
from ruamel.yaml.nodes import MappingNode, Node, SequenceNode

from paint_deposition.errors import LONGEST_QUOTED, PaintError
from paint_deposition.files.atomic import MOST_TEXT_MB, read_file

# Levels of a document, and values with each alias in full.
MOST_LEVELS, MOST_VALUES = 500, 100_000


def read_yaml(path: Path, kind: str, refusal: type[PaintError]) -> Any:
    """The one document of a file, which should be a ``kind``.

    Raises ``refusal`` where the file cannot be read, is no YAML, or gives a key twice.
    """
    try:
        text = read_file(path, refusal, MOST_TEXT_MB).decode('utf-8')
        require_small(text)
        return YAML(typ='safe', pure=True).load(text)
    except FileNotFoundError:
        raise refusal(f'{path}: no such file; give a {kind} YAML') from None
    except OSError as error:
        raise refusal(f'{path}: cannot be read ({error.strerror})') from None
    except (RecursionError, OverflowError):
        raise refusal(
            f'{path}: its values are nested too deeply, or too many by aliases; give a {kind} YAML'
        ) from None
    except UnicodeDecodeError:
        raise refusal(
            f'{path}: is no text, such as a workbook or a bag; give a {kind} YAML in UTF-8'
        ) from None
    except YAMLError as error:
        mark, problem = getattr(error, 'problem_mark', None), ' '.join(str(error).split())
        if mark is not None:
            problem = str(getattr(error, 'problem', error)).split(' with value')[0]
            problem = f'line {mark.line + 1}: {problem[:LONGEST_QUOTED]}'
        raise refusal(f'{path}: cannot be read as YAML ({problem})') from None


def require_small(text: str) -> None:
    """Refuse YAML that nests, or of which aliases make, more than any file of the trade has.

    Raises OverflowError, or what the text itself provokes. Parsers written in C would end the
    process; a few hundred bytes of aliases could stand for gigabytes.
    """
    depth = 0
    for mark in re.findall(r'[\[{}\]]', text):
        depth = max(depth + (1 if mark in '[{' else -1), 0)
        if depth > MOST_LEVELS:
            raise OverflowError('brackets')
    if max(map(len, re.findall(r'^[ \t?:-]*', text, re.MULTILINE)), default=0) > MOST_LEVELS:
        raise OverflowError('indentation')
    if re.search(r'(^|[\s\[{,])\*', text):
        _size(YAML(typ='safe', pure=True).compose(text), {})


def _size(node: Node | None, known: dict[int, int]) -> int:
    """How many values a node stands for, each alias in full."""
    if id(node) not in known:
        known[id(node)] = MOST_VALUES  # where it is found within itself
        held = node.value if isinstance(node, SequenceNode | MappingNode) else []
        pairs = isinstance(node, MappingNode)
        nodes = (part for one in held for part in (one if pairs else (one,)))
        known[id(node)] = 1 + sum(_size(part, known) for part in nodes)
    if known[id(node)] >= MOST_VALUES:
        raise OverflowError('aliases')
    return known[id(node)]
