"""Parquet tables, and what to install where a library of the extra `many` is missing."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from paint_deposition.errors import ManyError
from paint_deposition.files.atomic import replacing

if TYPE_CHECKING:
    import pyarrow as pa

MAGIC = b'PAR1'
PYARROW = 'pyarrow'
MANY = (PYARROW, 'ruptures')


def require_libraries(what: str, libraries: tuple[str, ...] = (PYARROW,)) -> None:
    """Refuse to begin what needs libraries of the extra, naming those that are missing."""
    missing = [name for name in libraries if find_spec(name) is None]
    if missing:
        named = f'{" and ".join(missing)}, which {"are" if missing[1:] else "is"}'
        raise ManyError(
            f'{what} needs {named} not installed; run: pip install {" ".join(missing)}'
        )


def write_parquet(path: Path, table: pa.Table) -> Path:
    """Write a table, whole or not at all."""
    import pyarrow.parquet as pq

    with replacing(path) as temporary:
        pq.write_table(table, temporary)
    return path
