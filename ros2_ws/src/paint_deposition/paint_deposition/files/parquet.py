"""Parquet tables, and what to install where their library is missing."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from paint_deposition.errors import BatchError
from paint_deposition.files.atomic import replacing

if TYPE_CHECKING:
    import pyarrow as pa

MAGIC = b'PAR1'


def require_pyarrow(what: str) -> None:
    """Refuse to begin what needs the library of the extra, where it is not installed."""
    if find_spec('pyarrow') is None:
        raise BatchError(f'{what} needs pyarrow, which is not installed; run: pip install pyarrow')


def write_parquet(path: Path, table: pa.Table) -> Path:
    """Write a table, whole or not at all."""
    import pyarrow.parquet as pq

    with replacing(path) as temporary:
        pq.write_table(table, temporary)
    return path
