"""Files that are written whole or not at all, after a power cut too, and read with a limit.

Texts, YAML, JSON that every reader takes (no NaN), Parquet tables, and texts by a template.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from pydantic_core import to_json, to_jsonable_python

from paint_deposition.errors import LONGEST_REASON, PaintError, shortened

if TYPE_CHECKING:
    import pyarrow as pa

# Of a file that is read as a whole [MB]: more is no mesh or table of this trade, or would fill the
# memory. Of a text that a person edits, and of YAML, which takes 10 s and 70 MB for each MB.
MOST_MB, MOST_TEXT_MB, MOST_YAML_MB = 2000, 20, 2
BLOCK_BYTES = 1 << 20
# In a folder of results, while they are written: the folder `new` in it holds them.
WORK = '.paint_work'
# Levels of a YAML document, and letters and values that its aliases stand for.
MOST_LEVELS, MOST_REPEATED = 500, 500_000


def require_file(path: str | Path, refusal: type[PaintError], most_mb: float = MOST_MB) -> Path:
    """The path; raise ``refusal`` for what is there and is no regular file, or is too large.

    A device or a pipe would be read for ever.
    """
    path = Path(path)
    if not path.exists() or path.is_dir():
        return path  # whoever reads it says so
    if not path.is_file():
        raise refusal(f'{path} is a device or a pipe; give a file')
    if (size_mb := path.stat().st_size / 1e6) > most_mb:
        raise refusal(f'{path} has {size_mb:.0f} MB; give a file of {most_mb:g} MB at most')
    return path


def read_file(path: str | Path, refusal: type[PaintError], most_mb: float = MOST_MB) -> bytes:
    """The content of a file that ``require_file`` takes. Raises OSError as Path.read_bytes."""
    return require_file(path, refusal, most_mb).read_bytes()


def read_yaml(path: Path, kind: str, refusal: type[PaintError]) -> Any:
    """The one document of a file, which should be a ``kind``.

    It is YAML 1.2 in which a key may not be given twice. Raises ``refusal`` where the file cannot
    be read or is none.
    """
    from ruamel.yaml.error import YAMLError

    try:
        text = read_file(path, refusal, MOST_YAML_MB).decode('utf-8')
    except FileNotFoundError:
        raise refusal(f'{path}: no such file; give a {kind} YAML') from None
    except OSError as error:
        raise refusal(f'{path}: cannot be read ({error.strerror})') from None
    except UnicodeDecodeError:
        raise refusal(
            f'{path}: is no text, such as a workbook or a bag; give a {kind} YAML in UTF-8'
        ) from None
    try:
        return load_yaml(text)
    except (RecursionError, OverflowError):
        raise refusal(
            f'{path}: its values are nested too deeply, or too many by aliases; give a {kind} YAML'
        ) from None
    except YAMLError as error:
        mark, problem = getattr(error, 'problem_mark', None), str(error)
        if mark is not None:
            problem = str(getattr(error, 'problem', error)).split(' with value')[0]
            problem = f'line {mark.line + 1}: {problem}'
        raise refusal(
            f'{path}: cannot be read as YAML ({shortened(problem, LONGEST_REASON)})'
        ) from None
    except Exception as error:  # whatever a date or a number that is none provokes
        raise refusal(
            f'{path}: cannot be read as YAML ({shortened(str(error))}); put such a value in '
            'quotes, without tags and escapes'
        ) from None


def load_yaml(text: str) -> Any:
    """The one document of a text of YAML 1.2, of no more than a file of the trade has.

    Raises OverflowError where it nests too deeply or aliases stand for too much, and whatever the
    text provokes. Parsers written in C would end the process; a few hundred bytes of aliases could
    stand for gigabytes.
    """
    from ruamel.yaml import YAML, events

    constructor, parser = YAML(typ='safe', pure=True).get_constructor_parser(text)
    take, size, repeated = parser.get_event, 0, 0
    opened: list[tuple[Any, int]] = []  # the anchors of the levels, and the size before each
    sizes: dict[Any, int] = {}  # of what has an anchor, with each alias in it in full

    def counted() -> Any:
        nonlocal size, repeated
        event = take()
        name, before = getattr(event, 'anchor', None), size
        match event:
            case events.CollectionStartEvent():
                opened.append((name, size))
                before = size - MOST_REPEATED  # where it is found within itself
            case events.CollectionEndEvent():
                name, before = opened.pop()
                size += 1
            case events.AliasEvent():
                size += sizes.get(name, 0)
                repeated += sizes.get(name, 0)
            case events.ScalarEvent():
                size += 1 + len(event.value.encode())
        if not isinstance(event, events.AliasEvent):
            sizes[name] = size - before
        if len(opened) > MOST_LEVELS or repeated >= MOST_REPEATED:
            raise OverflowError('it nests too deeply, or aliases stand for too much')
        return event

    vars(parser)['get_event'] = counted
    content = constructor.get_single_data()
    repr(content)  # raises ValueError for a number of thousands of digits
    return content


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Give a temporary name beside ``path`` to write to; it takes its place on success.

    The file and its folder are on disk when this returns. Whoever writes to the name creates the
    file, so that the system gives it the rights of the process.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f'.{path.stem}-{uuid4().hex}{path.suffix}')
    try:
        yield temporary
        _sync(temporary)
        os.replace(temporary, path)
        if os.name == 'posix':  # elsewhere a folder cannot be opened
            _sync(path.parent)
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: str | Path, text: str) -> None:
    """Write a text file, replacing an older one at once."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding='utf-8')


def _sync(path: Path) -> None:
    """Wait until a file or folder is on disk."""
    descriptor = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def filled(
    template: Path, filters: Mapping[str, Callable[..., Any]] | None = None, **values: Any
) -> str:
    """A file by its Jinja template, from these values; each must be there. HTML is escaped."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(template.parent), autoescape='.html' in template.suffixes,
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        keep_trailing_newline=True,
    )  # fmt: skip
    environment.filters.update(filters or {})
    return environment.get_template(template.name).render(values)


def write_parquet(path: Path, table: pa.Table) -> Path:
    """Write a table, whole or not at all."""
    import pyarrow.parquet as pq

    with replacing(path) as temporary:
        pq.write_table(table, temporary)
    return path


def write_json(path: str | Path, content: Mapping[str, Any]) -> None:
    """Write JSON, whole or not at all; see ``json_text``."""
    write_text(path, json_text(content) + '\n')


def json_text(content: Mapping[str, Any]) -> str:
    """JSON with arrays as lists and paths as text; numbers that are not finite become null."""
    return to_json(content, indent=2, inf_nan_mode='null', fallback=_without_numpy).decode()


def plain(value: Any) -> Any:
    """Numbers and containers of Python for those of NumPy; other values raise ValueError."""
    return to_jsonable_python(value, fallback=_without_numpy)


def _without_numpy(value: Any) -> Any:
    import numpy as np  # what only writes text does without

    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise ValueError(f'{type(value).__name__} cannot be written as JSON')
