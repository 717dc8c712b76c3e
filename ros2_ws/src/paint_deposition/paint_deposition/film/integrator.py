"""The one integrator: flux summed along the spray path on surface points, live and offline.

Offline commands give it a whole path; ``LiveFilm`` gives it the same path piece by piece as poses
come in. The film is the same to the last bit.
"""

import copy
import math
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from paint_deposition.effects.base import Effect, PathContext
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ModelError
from paint_deposition.film import layout
from paint_deposition.film.statistics import PaintUsed
from paint_deposition.kernel.blocks import LARGEST_BLOCK, THREADS, shared_among_threads
from paint_deposition.kernel.eq2_flux import CENTRE, REACH, RING, TERMS, Law, compile_kernel
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.points import SurfacePoints
from paint_deposition.part.surface import Surface
from paint_deposition.part.visibility import Obstacle, horizon_sines, sees

Precision = Literal['single', 'double']
# Sub-steps handed to the kernel at once, so that long work can report progress.
BATCH = 2048
# Fewer rays, points times sub-steps, are painted before other threads wake.
FEW_RAYS = 500_000
# Where the thickest film is thinner no paint landed: no gauge shows it.
NO_PAINT_UM = 0.05


@dataclass(frozen=True)
class Steps:
    """What the kernel reads of a path."""

    rows: np.ndarray  # (M, 16) sub-steps that spray, see ``layout.step_rows``
    brush: np.ndarray  # (M,) row among the model's patterns of the one that sprays
    # (N,) uint8, 1 where a point is seen, a run of points for each of S tracings and each block.
    seen: np.ndarray
    first: np.ndarray  # (S, B) where the run of a tracing and a block begins
    tracing: np.ndarray  # (M,) which tracing holds


class FilmIntegrator:
    """Accumulates the film of a model on surface points as the path comes in.

    Args:
        precision: 'single' for meshes (1e-6 of the peak), 'double' for fitting.
        occluder: the part that hides points from the gun; None where nothing can stand in the way.
        keep_absent_laws: compile the laws of absent effects too, so that a fit which varies them
            needs one kernel only; else an absent effect costs nothing.
        parallel: whether threads share the points; without, several integrators can paint at once.
    """

    def __init__(
        self,
        points: SurfacePoints,
        model: DepositionModel,
        precision: Precision = 'single',
        occluder: Surface | None = None,
        keep_absent_laws: bool = False,
        parallel: bool = True,
    ) -> None:
        self.points = points
        self._parallel = parallel
        self._real: Any = np.float32 if precision == 'single' else np.float64
        self._occluder = occluder
        # Of the sorted points; where nothing stands higher over a point it is seen.
        self._horizon: np.ndarray | None = None
        self._keep_absent_laws = keep_absent_laws
        self._blocks = points.blocks(self._real)
        self.reset()
        self.use(model)

    def use(self, model: DepositionModel) -> None:
        """Change the model; what was painted before stays as it is."""
        self.model = model
        self._context = PathContext(
            model.projection, self.points.down, self.points.outward, self.points.centre_m
        )
        self._shadowed = model.shadow > 0.0 and self._occluder is not None
        if self._occluder is not None and self._shadowed and self._horizon is None:
            order = self._blocks.order
            self._positions_m, self._normals = (
                self.points.positions_m[order],
                self.points.normals[order],
            )
            self._horizon = horizon_sines(self._occluder.tree, self._positions_m, self._normals)
        # Absent effects are left out rather than computed: they change nothing, to the bit.
        self._effects = [effect for effect in model.effects if not effect.is_neutral]
        compiled = model.effects if self._keep_absent_laws else self._effects
        # Each law with how many parameters it takes; one unused number where there are none.
        laws: list[tuple[tuple[Law, int], ...]] = []
        parameters: list[float] = []
        for kind in ('flux_factor', 'pattern_scale'):
            chosen = [(e, law) for e in compiled if (law := getattr(type(e), kind)) is not None]
            laws.append(tuple((law, len(effect.values())) for effect, law in chosen))
            parameters += [value for effect, _ in chosen for value in effect.values()]
        self._variant = (*laws, self._shadowed, self._real)
        self._parameters = np.array(parameters or [0.0], dtype=self._real)

    def reset(self) -> None:
        """Back to bare metal."""
        self._film = np.zeros(len(self._blocks.order))
        self._recent = np.zeros(len(self._blocks.order), dtype=self._real)
        self._done = 0
        self.used = PaintUsed()
        self._traced_from: np.ndarray | None = None

    def fork(self) -> 'FilmIntegrator':
        """A copy to paint on; this one stays as it is."""
        other = copy.copy(self)
        other._film, other._recent = self._film.copy(), self._recent.copy()
        return other

    def add(self, path: SprayPath, progress: Callable[[int], None] | None = None) -> None:
        """Paint along the path; ``progress`` is called with the sub-steps done so far."""
        self.add_sprayed(self.sprayed(path)[0], progress)

    def raw_of(self, path: SprayPath) -> np.ndarray:
        """(V,) film of this path alone as it arrives, before effects on the film [um]."""
        self.reset()
        self.add(path)
        return self.raw_um

    def add_sprayed(self, path: SprayPath, progress: Callable[[int], None] | None = None) -> None:
        """Paint along a path, or a part of one, that the effects on it have been applied to."""
        self.used += PaintUsed.of(self.model, path)
        for start in range(0, len(path), BATCH):
            part = path.select(slice(start, start + BATCH))
            self.paint(self._steps(part))
            if progress:
                progress(min(start + BATCH, len(path)))

    def steps(self, path: SprayPath) -> Steps:
        """A path prepared for this model, to be painted again and again."""
        # The pattern may still become wider: any reach.
        return self._steps(self.sprayed(path)[0], 1e6)

    def paint(self, steps: Steps) -> None:
        """Paint along a path that was prepared for the effects and projection of the model."""
        constants = layout.model_constants(self.model)
        self._run(False, steps, constants, self._film, self._recent, np.empty((TERMS, 0)))
        self._done += len(steps.rows)

    def terms(self, steps: Steps) -> np.ndarray:
        """(7 B, V) what the film of these sub-steps alone is made of, by brush.

        See ``layout.term_weights``. They depend on r, sigma1 and sigma2, and where the asymmetry
        is spread over the ring, but not on K1 and K2.
        """
        # Constants with which the terms are kept apart, whatever their gains.
        even, none = {'K1_cm3_per_s': 1.0, 'K2': 0.5}, np.empty(0)
        patterns = (planar.model_copy(update=even) for planar in self.model.patterns)
        constants = layout.model_constants(self.model.with_patterns(patterns))
        constants[:, [RING, CENTRE]] += 1.0
        terms = np.zeros((len(constants), TERMS, len(self._film)))
        for row, of_brush in enumerate(terms):
            on = steps.brush == row
            own = replace(
                steps, rows=steps.rows[on], brush=steps.brush[on], tracing=steps.tracing[on]
            )
            self._run(True, own, constants, none, none, of_brush)
        return self._in_order(terms.reshape(-1, len(self._film)))

    def sprayed(self, path: SprayPath) -> tuple[SprayPath, np.ndarray]:
        """What is really sprayed of a path, effects on it applied, and the rows that it is."""
        for effect in self._effects:
            path = effect.on_path(path, self._context)
        rows = np.flatnonzero(path.flow * path.dwell_s)
        return path if len(rows) == len(path) else path.select(rows), rows

    def _steps(self, path: SprayPath, reach: float | None = None) -> Steps:
        """What the kernel reads; ``reach`` of lines of sight, if it is not the pattern's."""
        rows = layout.step_rows(self.model, path, self._blocks.origin_m).astype(self._real)
        brush = self.model.pattern_rows(path.brush)
        if self._occluder is None or not self._shadowed:
            run = np.ones(LARGEST_BLOCK, dtype=np.uint8)  # everything is seen
            first = np.zeros((1, len(self._blocks.spheres)), np.int64)
            return Steps(rows, brush, run, first, np.zeros(len(rows), np.int64))
        constants = layout.model_constants(self.model)
        if reach is not None:
            constants[:, REACH] = reach
        origins_m = layout.emission_points_m(self.model, path)
        constants = constants.astype(self._real)
        return self._traced(self._occluder.obstacle, origins_m, rows, brush, constants)

    def _traced(
        self, obstacle: Obstacle, origins_m: np.ndarray,
        rows: np.ndarray, brush: np.ndarray, constants: np.ndarray,
    ) -> Steps:  # fmt: skip
        """Trace rays from the first origin (M, 3) and then after every SIGHT_STEP_M of travel.

        A point whose normal looks away needs no ray, nor does one over which the gun stands higher
        than all of the part, nor any of a block that lies out of the reach in ``constants``.
        """
        # (S, 3) origins from which to trace, and (M,) the row of them that holds.
        places_m = [] if self._traced_from is None else [self._traced_from]
        tracing = np.empty(len(origins_m), dtype=np.int64)
        for step, origin in enumerate(origins_m.tolist()):
            if not places_m or math.dist(origin, places_m[-1]) > layout.SIGHT_STEP_M:
                places_m.append(origin)
            tracing[step] = len(places_m) - 1
        traced, blocks = np.reshape(places_m, (-1, 3)), self._blocks
        lit = layout.reached_blocks(blocks.spheres, rows, tracing, brush, constants, len(traced))
        which, block = np.nonzero(lit)
        sizes = np.diff(blocks.bounds)[block]
        # The first run is that of whatever lies out of reach.
        starts = LARGEST_BLOCK + np.cumsum(sizes) - sizes
        first = np.zeros(lit.shape, dtype=np.int64)
        first[which, block] = starts
        seen = np.ones(LARGEST_BLOCK + sizes.sum(), dtype=np.uint8)
        begins = np.searchsorted(tracing, np.arange(len(traced) + 1))

        def trace(start: int, stop: int) -> None:
            some = slice(start, stop)
            places, tracings, points = layout.rays_to_trace(
                blocks.bounds, blocks.points, blocks.normals, self._positions_m, self._normals,
                self._horizon, traced, rows, begins, brush, constants,
                which[some], block[some], starts[some],
            )  # fmt: skip
            seen[places] = sees(obstacle, traced[tracings], self._positions_m[points])

        # RAYS_AT_ONCE or a little more in each.
        parts = np.cumsum(sizes) // layout.RAYS_AT_ONCE
        cuts = np.flatnonzero(np.diff(parts, prepend=-1))
        with ThreadPoolExecutor(THREADS) as threads:
            list(threads.map(trace, cuts, [*cuts[1:], len(sizes)]))
        self._traced_from = traced[-1] if len(traced) else None
        return Steps(rows, brush, seen, first, tracing)

    def _run(
        self, separate_terms: bool, steps: Steps, constants: np.ndarray,
        film: np.ndarray, recent: np.ndarray, terms: np.ndarray,
    ) -> None:  # fmt: skip
        blocks = self._blocks
        arguments = (
            blocks.points, blocks.normals, steps.seen, film, recent, terms, self._done,
            blocks.spheres, blocks.bounds, steps.rows, steps.first, steps.tracing, steps.brush,
            constants.astype(self._real), self._parameters,
        )  # fmt: skip
        kernel = compile_kernel(*self._variant, separate_terms)
        many = self._parallel and len(steps.rows) * len(self._film) >= FEW_RAYS
        count = len(blocks.spheres)
        shared_among_threads(
            count, lambda first, last: kernel(first, last, *arguments), 1 if many else count
        )

    def _in_order(self, values: np.ndarray) -> np.ndarray:
        """Values (..., V) of the sorted points in the order of the caller's."""
        sorted_back = np.empty(values.shape)
        sorted_back[..., self._blocks.order] = values
        sorted_back.flags.writeable = False  # one film is read by many
        return sorted_back

    @property
    def raw_um(self) -> np.ndarray:
        """(V,) film as it arrived, before effects on the film [um]."""
        return self._in_order(self._film + self._recent)

    @property
    def film_um(self) -> np.ndarray:
        """(V,) film [um]."""
        return after_effects('on_film', self.raw_um, self._effects, self.points)

    @property
    def gauge_um(self) -> np.ndarray:
        """(V,) what a gauge shows on that film [um]."""
        return after_effects('on_gauge', self.film_um, self._effects, self.points)


def after_effects(
    place: Literal['on_film', 'on_gauge'],
    film_um: np.ndarray,
    effects: Iterable[Effect],
    points: SurfacePoints,
) -> np.ndarray:
    """(V,) film that is there in the end, where (V,) arrived, or what a gauge shows on it [um].

    Raises:
        ModelError: an effect gives a film or a reading that is not finite.
    """
    for effect in effects:
        if effect.is_neutral:
            continue
        film_um = getattr(effect, place)(film_um, points)
        odd = np.flatnonzero(~np.isfinite(film_um))
        if len(odd):
            what = 'film' if place == 'on_film' else 'reading'
            raise ModelError(
                f'effect {effect.id!r} gives a {what} of {film_um[odd[0]]} µm at {len(odd)} of '
                f'{len(film_um)} points; correct its law, or take it out of the model'
            )
    return film_um
