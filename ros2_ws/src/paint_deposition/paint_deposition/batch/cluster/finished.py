"""Finished cases on disk, a Parquet file each: a run that was cut off is taken up again."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from paint_deposition.batch.cluster.packing import told_by_value
from paint_deposition.files.json_files import json_text
from paint_deposition.files.parquet import write_parquet

if TYPE_CHECKING:
    import pyarrow as pa

NAME = 'finished'
Columns = Mapping[str, Any]


def digest_of(*told: Any) -> str:
    """A name for what a case was computed from: 32 hexadecimal digits of SHA-256."""
    return hashlib.sha256(json_text({'told': told}).encode()).hexdigest()[:32]


def content_digest(value: Any) -> str:
    """The same for an input as it is in memory, such as a surface or a motion."""
    return hashlib.sha256(told_by_value(value)).hexdigest()[:32]


@dataclass(frozen=True)
class Finished:
    """A folder of finished cases.

    Attributes:
        folder: a Parquet file for each.
        given_up: columns of those that could not be computed; they are not kept.
    """

    folder: Path
    given_up: dict[str, Columns] = field(default_factory=dict)

    def has(self, digest: str) -> bool:
        """Whether a case is there; files appear whole."""
        return self._path(digest).is_file()

    def has_all(self, digests: Iterable[str]) -> bool:
        """Whether nothing is left to compute."""
        return all(map(self.has, digests))

    def add(self, digest: str, columns: Columns) -> None:
        """Keep a case: equally long columns by name."""
        import pyarrow as pa

        write_parquet(self._path(digest), pa.table(dict(columns)))

    def give_up(self, digest: str, columns: Columns) -> None:
        """Let a case have these columns until the next run tries it again."""
        self.given_up[digest] = columns

    def table(self, digests: Iterable[str]) -> pa.Table:
        """These cases, one after the other; columns that a case has not are empty in its rows."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        parts = [
            pa.table(dict(self.given_up[digest]))
            if digest in self.given_up
            else pq.read_table(self._path(digest))
            for digest in digests
        ]
        return pa.concat_tables(parts, promote_options='permissive')

    def _path(self, digest: str) -> Path:
        return self.folder / f'{digest}.parquet'
