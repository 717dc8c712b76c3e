"""Files that appear whole or not at all, after a power cut too."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4


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
