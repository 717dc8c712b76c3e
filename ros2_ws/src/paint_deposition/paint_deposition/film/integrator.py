"""The film: flux integrated along the spray path on surface points, with the model's effects."""

import copy
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Literal

import numba
import numpy as np

from paint_deposition.effects.base import PathContext
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.layout import emission_points_m, model_constants, step_rows
from paint_deposition.kernel.accumulation import compile_kernel
from paint_deposition.kernel.blocks import Blocks
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.points import SurfacePoints
from paint_deposition.part.visibility import Occluder

Precision = Literal['single', 'double']
# Lines of sight are traced anew after this travel of the emission point [m].
SIGHT_STEP_M = 0.01
# Sub-steps handed to the kernel at once, so that long work can report progress.
BATCH = 2048
# The simplest of the compiler's thread pools ends the process when two threads enter it at once.
_KERNEL_LOCK = threading.Lock()
# Fewer rays, points times sub-steps, are painted before other threads wake.
FEW_RAYS = 500_000


@contextmanager
def _threads(rays: int) -> Iterator[None]:
    """Paint few rays in this thread alone; the film does not depend on it."""
    threads = numba.get_num_threads()
    numba.set_num_threads(1 if rays < FEW_RAYS else threads)
    try:
        yield
    finally:
        numba.set_num_threads(threads)


class FilmIntegrator:
    """Accumulates the film on surface points as the path comes in.

    The live node and every offline command use this class; there is no other integrator.

    Args:
        points: where the film is wanted.
        model: the deposition model with its effects.
        precision: 'single' for meshes (1e-6 of the peak), 'double' for fitting.
        occluder: traces lines of sight; None where nothing can stand in the way.
        keep_absent_laws: compile the laws of absent effects too, so that a fit which varies them
            needs one kernel only; else an absent effect costs nothing.
    """

    def __init__(
        self,
        points: SurfacePoints,
        model: DepositionModel,
        precision: Precision = 'single',
        occluder: Occluder | None = None,
        keep_absent_laws: bool = False,
    ) -> None:
        self.points = points
        self._real: Any = np.float32 if precision == 'single' else np.float64
        self._occluder = occluder
        self._keep_absent_laws = keep_absent_laws
        self._blocks = Blocks.of(points.positions_m, points.normals, self._real)
        self.reset()
        self.use(model)

    def use(self, model: DepositionModel) -> None:
        """Change the model; what was painted before stays as it is."""
        self.model = model
        self._context = PathContext(
            model.projection, self.points.down, self.points.outward, self.points.centre_m
        )
        self._shadowed = model.shadow > 0.0 and self._occluder is not None
        # Absent effects are left out rather than computed: they change nothing, to the bit.
        self._effects = [effect for effect in model.effects if not effect.is_neutral]
        compiled = model.effects if self._keep_absent_laws else self._effects
        laws, values = [], []
        for kind in ('flux_factor', 'pattern_scale'):
            chosen = [e for e in compiled if getattr(type(e), kind) is not None]
            laws.append(tuple((getattr(type(e), kind), len(e.values())) for e in chosen))
            values += [value for e in chosen for value in e.values()]
        self._kernel: Any = compile_kernel(laws[0], laws[1], self._shadowed, self._real)
        self._compiled = False
        self._parameters = np.array(values or [0.0], dtype=self._real)
        self._constants = model_constants(model).astype(self._real)

    def reset(self) -> None:
        """Back to bare metal."""
        self._film = np.zeros(len(self._blocks.order))
        self._recent = np.zeros(len(self._blocks.order), dtype=self._real)
        self._done = 0
        self.emitted_cm3 = 0.0
        self._traced_from: np.ndarray | None = None
        self._last_seen = np.ones(len(self._blocks.order), dtype=np.uint8)

    def fork(self) -> 'FilmIntegrator':
        """One that goes on from here and leaves this one as it is."""
        other = copy.copy(self)
        other._film, other._recent = self._film.copy(), self._recent.copy()
        return other

    def add(self, path: SprayPath, progress: Callable[[int], None] | None = None) -> None:
        """Paint along the path; ``progress`` is called with the sub-steps done so far."""
        for effect in self._effects:
            path = effect.on_path(path, self._context)
        path = path.select(path.flow * path.dwell_s != 0.0)
        self.emitted_cm3 += self.model.planar.K1_cm3_per_s * path.spraying_time_s
        for start in range(0, len(path), BATCH):
            self._add_batch(path.select(slice(start, start + BATCH)))
            if progress:
                progress(min(start + BATCH, len(path)))

    def _add_batch(self, path: SprayPath) -> None:
        steps = step_rows(self.model, path, self._blocks.origin_m)
        visible, sight = self._lines_of_sight(emission_points_m(self.model, path))
        blocks = self._blocks
        arguments = (
            blocks.points,
            blocks.normals,
            visible,
            self._film,
            self._recent,
            self._done,
            blocks.spheres,
            blocks.bounds,
            steps.astype(self._real),
            sight,
            self._constants,
            self._parameters,
        )
        if not self._compiled:
            # Before the lock is taken: it may last seconds, and others paint meanwhile.
            self._kernel.compile(tuple(map(numba.typeof, arguments)))
            self._compiled = True
        with _KERNEL_LOCK, _threads(len(path) * len(self._film)):
            self._kernel(*arguments)
        self._done += len(path)

    def _lines_of_sight(self, origins_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Trace from the first origin and then after every SIGHT_STEP_M of travel.

        Returns:
            Which points are seen, one row a tracing, the first that of the path so far; and the
            row that holds for each origin (M,).
        """
        rows = np.zeros(len(origins_m), dtype=np.int64)
        if self._occluder is None or not self._shadowed:
            return self._last_seen[np.newaxis], rows
        wanted: list[np.ndarray] = []
        for step, origin in enumerate(origins_m):
            last = self._traced_from
            if last is None or np.linalg.norm(origin - last) > SIGHT_STEP_M:
                self._traced_from = origin
                wanted.append(origin)
            rows[step] = len(wanted)
        seen = self._last_seen[np.newaxis]
        if wanted:
            in_order = self.points.positions_m[self._blocks.order]
            traced = self._occluder.visible(np.array(wanted), in_order)
            seen = np.concatenate([seen, traced.astype(np.uint8)])
        self._last_seen = seen[-1].copy()
        return seen, rows

    @property
    def raw_um(self) -> np.ndarray:
        """(V,) film as it arrived, before effects on the film [um]."""
        film = np.empty(len(self._film))
        film[self._blocks.order] = self._film + self._recent
        return film

    @property
    def film_um(self) -> np.ndarray:
        """(V,) film [um]."""
        film = self.raw_um
        for effect in self._effects:
            film = effect.on_film(film, self.points)
        return film

    @property
    def gauge_um(self) -> np.ndarray:
        """(V,) what a gauge shows on that film [um]."""
        film = self.film_um
        for effect in self._effects:
            film = effect.on_gauge(film, self.points)
        return film
