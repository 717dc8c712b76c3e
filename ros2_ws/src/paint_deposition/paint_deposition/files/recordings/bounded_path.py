"""Files from which no more is read than they hold, whatever a damaged length in them claims."""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import Any

# Only a read of more than this is compared with the file.
LARGE_BYTES = 1_000_000


class BoundedPath(type(Path())):  # type: ignore[misc]
    """A path whose files, and those below it, are bounded where they are read as bytes."""

    def open(self, mode: str = 'r', *args: Any, **kwargs: Any) -> Any:
        """As `Path.open`."""
        if mode == 'rb':
            return _BoundedReader(io.FileIO(self))
        return super().open(mode, *args, **kwargs)


class _BoundedReader(io.BufferedReader):
    """Python takes memory for all that is asked for before it reads."""

    def read(self, size: int | None = -1, /) -> bytes:
        if size is not None and size > LARGE_BYTES:
            size = min(size, max(0, os.fstat(self.fileno()).st_size - self.tell()))
        return super().read(size)
