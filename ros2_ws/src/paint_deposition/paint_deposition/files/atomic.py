"""Files that are written whole or not at all, after a power cut too, and read with a limit."""

import os
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4

from paint_deposition.errors import PaintError

# Of a file that is read as a whole [MB]: more is no mesh or table of this trade, or would fill the
# memory. Of a text that a person edits.
MOST_MB, MOST_TEXT_MB = 2000, 20
MOST_EXPANDED_BYTES, BLOCK_BYTES = 1_000_000_000, 1 << 20


def require_file(path: str | Path, refusal: type[PaintError], most_mb: float = MOST_MB) -> None:
    """Raise ``refusal`` for what is there and is no regular file or folder, or is too large.

    A device or a pipe would be read for ever.
    """
    path = Path(path)
    if not path.exists() or path.is_dir():
        return  # whoever reads it says so
    if not path.is_file():
        raise refusal(f'{path} is a device or a pipe; give a file')
    if (size_mb := path.stat().st_size / 1e6) > most_mb:
        raise refusal(f'{path} has {size_mb:.0f} MB; give a file of {most_mb:g} MB at most')


def require_small_package(package: zipfile.ZipFile) -> None:
    """Raise BadZipFile for one that is too large when it is expanded, or says it is smaller."""
    left = MOST_EXPANDED_BYTES
    for member in package.infolist():
        left -= member.file_size
        if left < 0:
            raise zipfile.BadZipFile(f'it holds over {MOST_EXPANDED_BYTES / 1e6:g} MB, expanded')
        try:
            with package.open(member) as content:  # the end is compared with what the head says
                while content.read(BLOCK_BYTES):
                    pass
        except (EOFError, NotImplementedError, RuntimeError, ValueError, zlib.error) as error:
            raise zipfile.BadZipFile(
                f'{member.filename}: {str(error) or "it breaks off"}'
            ) from None


def read_file(path: str | Path, refusal: type[PaintError], most_mb: float = MOST_MB) -> bytes:
    """The content of a file that ``require_file`` takes. Raises OSError as Path.read_bytes."""
    require_file(path, refusal, most_mb)
    return Path(path).read_bytes()


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
