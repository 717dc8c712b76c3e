"""The part in the cell, and parts whose mesh is read before they come."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from datetime import datetime, timezone
from pathlib import Path

from paint_deposition.film.common_film import LiveFilms
from paint_deposition.nodes.painting.film_messages import ShownFilm
from paint_deposition.part.points import SurfacePoints
from paint_deposition.part.surface import Surface

# A large part takes some 100 MB.
MOST_KEPT = 4


@dataclass(frozen=True)
class Part:
    """The part in the cell, as it was announced.

    Attributes:
        mesh_file: its mesh.
        type: what the cell calls its kind, '' where nobody said.
        serial: its serial number, '' where nobody said.
        coat: 1 for the first coat on it.
        since: when it came.
    """

    mesh_file: str
    type: str = ''
    serial: str = ''
    coat: int = 1
    since: datetime = field(default_factory=lambda: datetime.now(timezone.utc))

    @property
    def run(self) -> str:
        """The folder of its run, '' for a part without a serial number."""
        return self.serial if self.coat == 1 else f'{self.serial}_coat_{self.coat}'


@dataclass(frozen=True)
class PreparedPart:
    """A part that can be painted at once.

    Attributes:
        surface: refined. points: where it is painted.
        film: bare, of all guns. shown: its messages.
    """

    surface: Surface
    points: SurfacePoints
    film: LiveFilms
    shown: ShownFilm


class PreparedParts:
    """Reads parts in a thread, and keeps the latest of them by their mesh.

    Args:
        prepare: reads a mesh file and makes all that painting it takes; runs in the thread.
    """

    def __init__(self, prepare: Callable[[str], PreparedPart]) -> None:
        self._prepare = prepare
        self._kept: dict[tuple, Future[PreparedPart]] = {}
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix='parts')

    @property
    def ready(self) -> list[str]:
        """The mesh files that are prepared."""
        return [key[0] for key, part in self._kept.items() if part.done()]

    def get(self, mesh_file: str) -> Future[PreparedPart]:
        """The part of this mesh as it is on disk now; it is read unless it has been."""
        key = _version_of(mesh_file)
        part = self._kept.pop(key, None)
        if part is None or (part.done() and part.exception()):
            part = self._thread.submit(self._prepare, mesh_file)
        self._keep(key, part)
        return part

    def put_back(self, mesh_file: str, part: PreparedPart) -> None:
        """Keep a part that has left the cell: the next of its kind is prepared then."""
        done: Future[PreparedPart] = Future()
        done.set_result(part)
        self._keep(_version_of(mesh_file), done)

    def take(self, mesh_file: str) -> None:
        """Forget a part that is in the cell now: its film is in use."""
        self._kept.pop(_version_of(mesh_file), None)

    def close(self) -> None:
        """Wait for what is being read."""
        self._thread.shutdown(cancel_futures=True)

    def _keep(self, key: tuple, part: Future[PreparedPart]) -> None:
        self._kept[key] = part
        while len(self._kept) > MOST_KEPT:
            self._kept.pop(next(iter(self._kept)))


def _version_of(mesh_file: str) -> tuple:
    """What tells that a file is still the same."""
    path = Path(mesh_file)
    try:
        status = os.stat(path)
    except OSError:
        return str(path), None, None  # reading it says what is wrong
    return str(path), status.st_mtime_ns, status.st_size
