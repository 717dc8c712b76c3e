"""Cases of a sweep: what each is computed from, and a cache of their results on disk.

The cache is our own: joblib's keeps pickles under a digest of the function's text alone, while
these are Parquet tables that a user opens, found again only by the same code of the whole package.
"""

from __future__ import annotations

import hashlib
import io
import pickle
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import paint_deposition
from paint_deposition.effects.base import Effect
from paint_deposition.effects.user_effects import effect_of
from paint_deposition.files.json_files import json_text
from paint_deposition.files.parquet import write_parquet

if TYPE_CHECKING:
    import pyarrow as pa

Columns = Mapping[str, Any]


@dataclass(frozen=True)
class Case:
    """One piece of work."""

    digest: str  # of all that it is computed from; the same digest is never computed twice
    parameters: Any  # of this case alone, small
    # Names of what it shares with other cases, such as a part or a motion.
    inputs: tuple[str, ...] = ()
    # Columns of its row that need no computation.
    known: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class ResultCache:
    """A folder of results, a Parquet file for each case: a run that was cut off is resumed."""

    folder: Path  # of the files, each written as a whole
    # Columns of cases that could not be computed; the next run tries them again.
    failures: dict[str, Columns] = field(default_factory=dict)

    def has(self, digest: str) -> bool:
        """Whether the result of a case is stored."""
        return self._path(digest).is_file()

    def add(self, digest: str, columns: Columns) -> None:
        """Keep the result of a case: equally long columns by name."""
        import pyarrow as pa

        write_parquet(self._path(digest), pa.table(dict(columns)))

    def table(self, digests: Iterable[str]) -> pa.Table:
        """These cases, one after the other; columns that a case lacks are empty in its rows."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        parts = [
            pa.table(dict(self.failures[digest]))
            if digest in self.failures
            else pq.read_table(self._path(digest))
            for digest in digests
        ]
        return pa.concat_tables(parts, promote_options='permissive')

    def _path(self, digest: str) -> Path:
        return self.folder / f'{digest}.parquet'


def digest_of(*values: Any) -> str:
    """32 hexadecimal digits of SHA-256 for values that JSON can hold."""
    return hashlib.sha256(json_text({'values': values}).encode()).hexdigest()[:32]


@cache
def code_digest() -> str:
    """The same for the package's version and all its sources."""
    package = Path(paint_deposition.__file__).parent
    digest = hashlib.sha256(paint_deposition.__version__.encode())
    for file in sorted(package.rglob('*.py')):
        digest.update(str(file.relative_to(package)).encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()[:32]


def serialised(value: Any) -> bytes:
    """Bytes that ``pickle.loads`` opens elsewhere; the files of users' effects run there."""
    content = io.BytesIO()
    _EffectPickler(content, protocol=5).dump(value)
    return content.getvalue()


class _EffectPickler(pickle.Pickler):
    def reducer_override(self, value: Any) -> Any:
        if isinstance(value, type) and issubclass(value, Effect) and value.file is not None:
            return effect_of, (value.file, value.file_content)
        return NotImplemented
