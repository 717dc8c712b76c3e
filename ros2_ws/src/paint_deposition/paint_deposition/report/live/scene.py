"""What the live page shows of a part, and what a browser still lacks of it."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from threading import Lock
from typing import Any

import numpy as np

from paint_deposition.film.colour_scales import FILM_PALETTE, RESIDUAL_PALETTE, ColourScale
from paint_deposition.part.surface import Surface

# Columns of the history of the film, behind the time [s]; names of ``FilmStatistics``.
FIGURES = (
    'mean_um', 'std_dev_um', 'min_um', 'max_um', 'coverage', 'within_target',
    'painted_volume_cm3', 'capture_fraction',
)  # fmt: skip
# Steps in which the film is shown, finer than a gauge's: less is no change that travels.
STEP_UM = 1.0 / 32.0
# Rows of a series beyond which its older half is forgotten: hours of figures, 500 m of a track.
MOST_ROWS = 50_000

Arrays = Mapping[str, np.ndarray] | None


def frame(kind: str, arrays: Arrays = None, **values: Any) -> bytes:
    """A message to the page: the length of its head (uint32), the head as JSON, the arrays."""
    arrays = arrays or {}
    listed = [[name, array.dtype.name, array.size] for name, array in arrays.items()]
    # JSON knows no NaN and no infinity; the page takes null for them.
    plain = {
        k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in values.items()
    }
    head = json.dumps({'kind': kind, **plain, 'arrays': listed}, allow_nan=False).encode()
    return b''.join(
        [len(head).to_bytes(4, 'little'), head, *(a.tobytes() for a in arrays.values())]
    )


@dataclass
class Seen:
    """What one browser has been sent."""

    blocks: dict[str, bytes] = field(default_factory=dict)
    film: np.ndarray = field(default_factory=lambda: np.empty(0, np.uint16))
    # Of each series the list itself, since another one may take its place, and how much of it.
    rows: dict[str, tuple[list[Sequence[float]], int]] = field(default_factory=dict)


class Scene:
    """A part with its film, guns, history and readings; any thread may change and send it.

    A film travels as 16-bit floats, good to 0.016 µm or 0.05 %, and of these only those that a
    browser does not have: a slow one gets fewer messages and ends with the same film.
    """

    def __init__(self, part: str = '', model: str = '') -> None:
        self.part, self.model = part, model
        self._lock = Lock()
        # Messages by kind, each of which takes the place of the last.
        self._blocks: dict[str, bytes] = {}
        self._film: np.ndarray = np.empty(0, np.uint16)
        self._rows: dict[str, list[Sequence[float]]] = {}
        # Of each gun: number, last point of its track, whether it sprayed there.
        self._guns: dict[str, tuple[int, np.ndarray | None, bool]] = {}
        self._shown: dict[str, dict[str, Any]] = {}

    def show_part(self, surface: Surface) -> None:
        """Show a bare part."""
        arrays = {
            'vertices': surface.vertices_m.astype(np.float32),
            'faces': surface.faces.astype(np.uint32),
        }
        sides = {'outward': surface.outward.tolist(), 'down': surface.down.tolist()}
        with self._lock:
            self._blocks = {'part': frame('part', arrays, **sides)}
            self._film = np.zeros(len(surface.vertices_m), np.uint16)
            self._rows, self._guns, self._shown = {}, {}, {}

    def begin_again(self) -> None:
        """Forget tracks and history; the next film takes the place of this one."""
        with self._lock:
            self._rows, self._guns, self._shown = {}, {}, {}
            self._set('guns', frame('guns', guns=[]))

    def tell(
        self, kind: str, arrays: Mapping[str, np.ndarray] | None = None, **values: Any
    ) -> None:
        """Set what the page shall know of one kind."""
        with self._lock:
            self._set(kind, frame(kind, arrays, **values))

    def show_scale(
        self, scale: ColourScale, bare_um: float, target_um: float = 0.0, tolerance_um: float = 0.0
    ) -> None:
        """Say which film [um] has which colour, and which film is wanted."""
        palettes = np.stack([FILM_PALETTE, RESIDUAL_PALETTE])
        self.tell('scale', {'palettes': palettes}, low=scale.low, high=scale.high, bare=bare_um,
                  target=target_um, tolerance=tolerance_um)  # fmt: skip

    def show_film(self, film_um: np.ndarray) -> None:
        """Show a film (V,) at the vertices of the part [um]."""
        with self._lock:
            self._film = (np.rint(film_um / STEP_UM) * STEP_UM).astype(np.float16).view(np.uint16)

    def add_figures(self, time_s: float, figures: Any, rmse_um: float = np.nan) -> None:
        """Add to the history: the attributes ``FIGURES`` of statistics, and the residual's RMS."""
        values = (getattr(figures, name) for name in FIGURES)
        row = [time_s, *(np.nan if value is None else value for value in values), rmse_um]
        with self._lock:
            self._append('history', row)

    def move_gun(self, name: str, position_m: np.ndarray, z_axis: np.ndarray, flow: float) -> None:
        """Show a gun at its TCP (3,) [m] with tool z (3,), and add to its track."""
        with self._lock:
            number, left_m, sprayed = self._guns.get(name, (len(self._guns), None, False))
            sprays = flow > 0.0
            # A gun that has moved by so much leaves another point of its track [m].
            if left_m is None or sprays != sprayed or np.linalg.norm(position_m - left_m) > 0.01:
                self._append('track', (number, *position_m.tolist(), sprays))
                left_m = position_m
            self._guns[name] = number, left_m, sprays
            shown = {'at': position_m.tolist(), 'z': z_axis.tolist(), 'flow': flow}
            self._shown[name] = shown
            self._set('guns', frame('guns', guns=list(self._shown.values())))

    def lacking(self, seen: Seen) -> list[bytes]:
        """The messages that bring a browser up to date; it counts as having seen them."""
        with self._lock:
            blocks, film = dict(self._blocks), self._film
            rows = {name: (kept, len(kept)) for name, kept in self._rows.items()}
        frames = [block for kind, block in blocks.items() if seen.blocks.get(kind) != block]
        if seen.blocks.get('part') != blocks.get('part'):
            seen.film = np.zeros(len(film), np.uint16)
        seen.blocks = blocks
        changed = film != seen.film
        if changed.any():
            mask = np.packbits(changed, bitorder='little')
            frames.append(frame('film', {'changed': mask, 'um': film[changed]}))
            seen.film = film
        for name in [*seen.rows, *(name for name in rows if name not in seen.rows)]:
            kept, count = rows.get(name, ([], 0))
            had, first = seen.rows.get(name, (kept, 0))
            first = first if had is kept else 0
            if had is not kept or count > first:
                new = np.array(kept[first:count], np.float32)
                frames.append(frame('rows', {'rows': new}, series=name, first=first))
                seen.rows[name] = kept, count
        return frames

    def _append(self, series: str, row: Sequence[float]) -> None:
        rows = self._rows.setdefault(series, [])
        if len(rows) >= MOST_ROWS:
            rows = self._rows[series] = rows[MOST_ROWS // 2 :]
        rows.append(row)

    def _set(self, kind: str, block: bytes) -> None:
        if self._blocks.get(kind) != block:
            self._blocks[kind] = block
