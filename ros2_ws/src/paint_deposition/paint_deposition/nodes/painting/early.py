"""What a painting node does early, so that neither its start nor the first pose waits for it."""

from __future__ import annotations

import contextlib
import importlib
import sys
import threading
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numba
import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.integrator import Precision
from paint_deposition.film.live_film import LiveFilm
from paint_deposition.part.facing import facing
from paint_deposition.part.points import SurfacePoints
from paint_deposition.part.surface import Surface

if TYPE_CHECKING:
    from paint_deposition.nodes.painting.painting_node import PaintingNode

# After the node has told that it is ready.
LOOK_AFTER_S = 0.1


def load_numba_without_scipy() -> None:
    """Load what Numba has for arrays, without all of `scipy.linalg`: a tenth of the start.

    Numba looks for SciPy's BLAS just then, for `np.convolve` alone; what else multiplies matrices
    looks when it is compiled.
    """
    if 'scipy.linalg' in sys.modules:
        return
    modules: dict[str, Any] = sys.modules
    modules['scipy.linalg.cython_blas'] = None
    try:
        importlib.import_module('numba.np.arraymath')
    finally:
        del modules['scipy.linalg.cython_blas']


# While it is imported, before another thread can look for the same.
load_numba_without_scipy()


def paint_in_one_thread() -> None:
    """Let this thread paint alone; other threads, one that repaints say, still share their work.

    Motion comes in pieces of milliseconds: threads that wait for the next one would take more of
    the processor than the painting.
    """
    numba.set_num_threads(1)


def load_what_paints(models: Iterable[DepositionModel], precision: Precision) -> threading.Thread:
    """Load, or compile, what paints with these models in a thread, while the part is read."""

    def load() -> None:
        few = SurfacePoints(np.eye(3), np.eye(3))
        for model in models:
            # Of a user's effect; what matters is raised again for the part itself.
            with contextlib.suppress(Exception):
                LiveFilm(few, model, precision=precision).warm_up()

    thread = threading.Thread(target=load, name='loading', daemon=True)
    thread.start()
    return thread


def look_at_once(surface: Surface) -> None:
    """Make what is looked up along a gun's axis, a second's work for a large part."""
    facing(surface, np.zeros((1, 3)), np.eye(3)[2:])


def look_soon(node: PaintingNode) -> None:
    """The same for the part of a node that has started."""

    def look() -> None:
        node.destroy_timer(timer)
        look_at_once(node.surface)

    timer = node.create_steady_timer(LOOK_AFTER_S, look)
