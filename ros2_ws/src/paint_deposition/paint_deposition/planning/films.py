"""Films that plans are made from: of a motion, of single passes, and of pieces of a pass."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.integrator import FilmIntegrator, after_film_effects
from paint_deposition.film.paint_used import PaintUsed, paint_figures
from paint_deposition.film.statistics import FilmStatistics, film_statistics
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.motion.programmed import Move
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.part.points import SurfacePoints
from paint_deposition.part.surface import Surface
from paint_deposition.planning.clearance import Contact
from paint_deposition.planning.driving import Drive
from paint_deposition.planning.improvement.nodes import Nodes
from paint_deposition.planning.improvement.programme import Programme
from paint_deposition.planning.passes import PassStyle, PlannedPass, plan_pass, trajectory_of
from paint_deposition.planning.requests import GunEnvelope, PlanRequest
from paint_deposition.planning.surface_map import SurfaceMap
from paint_deposition.planning.wanted_film import WantedFilm

MOST_POINTS = 1500
LINES_PER_SCALE = 5.0
COARSEST_STEP_M = 0.02
# Sub-steps of single passes may be coarser than for a film: 1e-4 of the peak; of nodes: 1e-3.
STEPS_PER_SCALE, STEPS_PER_SIGMA = 5.0, 6.0
# Slower poses would be gaps, at which the gun is off.
SLOWEST_RATE_HZ = 10.0
# A mean film this close to the target is on it; speeds this close to a limit keep it.
NEAR = 0.01


def simulated(
    surface: Surface,
    model: DepositionModel,
    trajectory: Trajectory,
    progress: Callable[[float], None] = lambda share: None,
) -> tuple[np.ndarray, PaintUsed]:
    """(V,) film of a motion [um], and what it sprays."""
    path, _ = spray_path(trajectory, max_step_m=model.max_step_m)
    integrator = FilmIntegrator(surface.points(), model, occluder=surface.occluder)
    integrator.add(path, lambda done: progress(done / len(path)))
    return integrator.film_um, integrator.used


def predicted(
    surface: Surface,
    model: DepositionModel,
    request: PlanRequest,
    wanted: WantedFilm,
    trajectory: Trajectory,
    progress: Callable[[float], None] = lambda share: None,
) -> dict[str, Any]:
    """The film of a planned motion and its figures, as fields of a ``PlannedFilm``.

    Within a tenth of the target, if there is one, it is good; in zones within their tolerance.
    """
    film, paint = simulated(surface, model, trajectory, progress)
    region, target = wanted.region, request.target_um or 0.0
    area = surface.vertex_areas_m2[region]
    statistics = film_statistics(
        film[region], area, paint.emitted_cm3, target_um=target, target_tolerance_um=0.1 * target,
        zones=wanted.zones and wanted.zones.select(region),
    )  # fmt: skip
    whole_part = film_statistics(
        film, surface.vertex_areas_m2, paint.emitted_cm3, target_um=target,
        target_tolerance_um=0.1 * target, zones=wanted.zones,
    )  # fmt: skip
    return {
        'surface': surface, 'model': model, 'request': request, 'wanted': wanted,
        'trajectory': trajectory, 'film_um': film, 'paint': paint, 'statistics': statistics,
        'whole_part': whole_part,
        'sigma_n': evenness(film[region] / wanted.share[region], area)[1],
    }  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class PlannedFilm:
    """Passes on a part with the film that the model predicts."""

    surface: Surface
    model: DepositionModel
    request: PlanRequest
    wanted: WantedFilm  # on the side or the faces that are painted
    passes: tuple[PlannedPass, ...]  # in running order
    trajectory: Trajectory  # their timed poses and trigger
    moves: tuple[Move, ...]  # of a robot program along them
    film_um: np.ndarray  # (V,) on the refined part
    paint: PaintUsed
    statistics: FilmStatistics  # of the film where one is wanted
    whole_part: FilmStatistics  # of the film on the whole part
    # Standard deviation over mean there, of the film over its own target, bare metal included.
    sigma_n: float
    drive: Drive | None = None  # of the robot that it was made for
    contacts: tuple[Contact, ...] = ()  # where gun or spray come too close to the part
    envelope: GunEnvelope = field(default_factory=GunEnvelope)  # of the gun

    @property
    def painted(self) -> np.ndarray:
        """(V,) bool, vertices whose film counts."""
        return self.wanted.region

    @property
    def mean_um(self) -> float:
        """Mean film on the painted part, bare metal included [um]."""
        area = self.surface.vertex_areas_m2[self.painted]
        return evenness(self.film_um[self.painted], area)[0]

    @property
    def region(self) -> str:
        """Where its figures are taken, in words."""
        area_m2 = self.surface.vertex_areas_m2[self.painted].sum()
        return f'the {area_m2:.2f} of {self.surface.area_m2:.2f} m2 to be painted'

    @property
    def cycle_time_s(self) -> float:
        """From the first pose to the last [s]."""
        return self.trajectory.duration_s

    @property
    def sprayed_speeds_m_per_s(self) -> list[float]:
        """Of the moves that spray."""
        return [move.speed_m_per_s for move in self.moves if move.spraying]

    @cached_property
    def path(self) -> SprayPath:
        """The motion cut into sub-steps."""
        return spray_path(self.trajectory)[0]

    @property
    def sentence(self) -> str:
        """The plan in a sentence."""
        return (
            f'mean film {self.statistics.mean_um:.1f} µm, sigma_n {100 * self.sigma_n:.1f} % on '
            f'{self.region}, {self.cycle_time_s:.1f} s'
        )

    @property
    def warnings(self) -> Iterator[str]:
        """Where the plan is not what was asked for, a line each."""
        request, target = self.request, self.request.target_um
        yield from map(str, self.drive.limits if self.drive else ())
        yield from map(str, self.contacts)
        yield from self.wanted.doubts(self.statistics)
        at_speed = request.speed_m_per_s and not self.wanted.zones
        if target and at_speed and abs(self.mean_um / target - 1.0) > NEAR:
            yield (
                f'at the speed given the mean film will be {self.mean_um:.1f} µm, not the target '
                f'of {target:g} µm; leave out the speed and it is chosen for the target'
            )
        slowest, fastest = min(self.sprayed_speeds_m_per_s), max(self.sprayed_speeds_m_per_s)
        least, most = request.speed_min_m_per_s, request.speed_max_m_per_s
        outside = slowest < (1.0 - NEAR) * least or fastest > (1.0 + NEAR) * most
        if outside and not request.optimise:  # which keeps them
            yield (
                f'the passes run at {slowest:.3g} to {fastest:.3g} m/s, where {least:g} to '
                f'{most:g} m/s are allowed (--speed-min, --speed-max)'
            )

    def __repr__(self) -> str:
        return f'{type(self).__name__}({self.sentence})'

    def to_dict(self) -> dict[str, Any]:
        """Figures of the plan."""
        return {
            'direction': self.request.direction,
            'passes': len(self.passes),
            'cycle_time_s': self.cycle_time_s,
            'sprayed_m': sum(planned.sprayed_m for planned in self.passes),
            'sigma_n': self.sigma_n,
            'region': self.region,
            'film': self.statistics.to_dict(),
            'whole_part': self.whole_part.to_dict(),
            'paint': paint_figures(self),
            'gun': self.envelope.model_dump(),
            'contacts': [contact.to_dict() for contact in self.contacts],
            'warnings': list(self.warnings),
            'robot': self.drive and self.drive.to_dict(),
        }


def evenness(film_um: np.ndarray, area_m2: np.ndarray) -> tuple[float, float]:
    """Mean film [um] and sigma_n, weighted by area."""
    weight = area_m2 / area_m2.sum()
    mean = float(weight @ film_um)
    sigma = math.sqrt(float(weight @ (film_um - mean) ** 2))
    return mean, sigma / mean if mean > 0.0 else math.nan


def stratified_sample(area_m2: np.ndarray) -> np.ndarray:
    """Rows that stand for equal shares of the area, MOST_POINTS at most."""
    reached = np.cumsum(area_m2)
    count = min(MOST_POINTS, 4 * len(area_m2))
    shares = (np.arange(count) + 0.5) / count * reached[-1]
    return np.searchsorted(reached, shares)


class LineFilms:
    """Film at points spread evenly over the painted side, for passes along many lines.

    Shadows and effects on the finished film are left out. ``finest_m`` is the scale on which the
    film changes across a pass; lines are laid up to ``beyond_m`` past the part's edges.

    Attributes:
        lines_m: (L,) the lines, and low_m and high_m their ends [m].
        films_um: (L, V) film of each pass at the part's vertices ``rows`` (V,).
    """

    def __init__(
        self,
        surface: Surface,
        surface_map: SurfaceMap,
        model: DepositionModel,
        style: PassStyle,
        finest_m: float,
        beyond_m: float,
        progress: Callable[[float], None] = lambda share: None,
    ) -> None:
        chosen = stratified_sample(surface.vertex_areas_m2[surface_map.painted])
        self.rows = rows = np.flatnonzero(surface_map.painted)[chosen]
        self.surface_map = surface_map
        points = SurfacePoints(surface.vertices_m[rows], surface.normals[rows], down=surface.down)
        low, high = surface_map.extent_m[1]
        self.low_m, self.high_m = low - beyond_m, high + beyond_m
        step = min(finest_m / LINES_PER_SCALE, COARSEST_STEP_M)
        count = math.ceil((self.high_m - self.low_m) / step) + 1
        self.lines_m = np.linspace(self.low_m, self.high_m, count)
        integrator = FilmIntegrator(points, model)
        longest = finest_m / STEPS_PER_SCALE
        # Poses about a sub-step apart.
        rate = max(style.speed_m_per_s / longest, SLOWEST_RATE_HZ)
        self.films_um = np.empty((count, len(rows)))
        for k, across in enumerate(self.lines_m):
            line = (plan_pass(surface_map, float(across), style),)
            motion = trajectory_of(line, style, rate_hz=rate)
            path, _ = spray_path(motion, max_step_m=longest)
            integrator.reset()
            integrator.add(path)
            self.films_um[k] = integrator.raw_um
            progress((k + 1) / count)
        # Cubic splines through the lines' films are linear in them: one matrix for all points.
        self._basis = CubicSpline(self.lines_m, np.eye(count))

    def sigma_n(self, lines_m: np.ndarray) -> np.ndarray:
        """(...) standard deviation over mean of the film of passes along lines (..., n) [m]."""
        weights = self._basis(np.clip(lines_m, self.low_m, self.high_m)).sum(axis=-2)
        film = weights @ self.films_um
        return film.std(axis=-1) / film.mean(axis=-1)


class FilmAtPoints:
    """Films at vertices of a part, with the model's effects, the film's own included.

    They are divided by ``share`` (V,), the target of each vertex over the mean target.
    """

    def __init__(
        self, surface: Surface, rows: np.ndarray, model: DepositionModel, share: np.ndarray
    ) -> None:
        self.model, self._share = model, share
        self._surface, self._rows = surface, rows
        points = surface.points().select(rows)
        self._integrator = FilmIntegrator(points, model, occluder=surface.occluder)
        narrow = min(min(p.sigma1_m, p.sigma2_m) for p in model.patterns)
        self.step_m = max(model.max_step_m, narrow / STEPS_PER_SIGMA)
        self._settles = [e for e in model.effects if type(e).on_film is not Effect.on_film]

    def film_um(self, programme: Programme) -> np.ndarray:
        """(V,) film of a programme at the points [um]."""
        path, _ = spray_path(programme.trajectory(), max_step_m=self.step_m)
        self._integrator.reset()
        self._integrator.add(path)
        return self._integrator.raw_um * self._finished_over_arrived(path) / self._share

    def of_nodes(self, programme: Programme, nodes: Nodes, density: np.ndarray) -> np.ndarray:
        """(n, V) films for a density of paint of 1 s/m at each node [um].

        Density is slowness times flow. The film is linear in it, but for effects that depend on
        the speed or on the time since the gun opened: they are taken as they are in this
        programme, which was timed at a density of paint (n,) [s/m].
        """
        path, _ = spray_path(programme.trajectory(), max_step_m=self.step_m)
        travel = programme.travel_at_m(path.stamp_ns)
        # The opening that each sub-step belongs to: the last that has begun.
        begun = np.searchsorted(programme.ends_m[:, 0], travel, side='right')
        sprayed, rows = self._integrator.sprayed(path)
        hats = nodes.hats(travel[rows], np.maximum(begun - 1, 0)[rows])
        shares = hats.multiply(1.0 / (hats @ density)[:, np.newaxis]).tocsc()
        films = np.empty((len(nodes), len(self._rows)))
        for node in range(len(nodes)):
            column = slice(shares.indptr[node], shares.indptr[node + 1])
            part = sprayed.select(shares.indices[column])
            self._integrator.reset()
            self._integrator.add_sprayed(part.with_(dwell_s=part.dwell_s * shares.data[column]))
            films[node] = self._integrator.raw_um
        return films * self._finished_over_arrived(path) / self._share

    def _finished_over_arrived(self, path: SprayPath) -> np.ndarray | float:
        """(V,) finished film over the film that arrived, from effects on the finished film."""
        if not self._settles:
            return 1.0
        everywhere = self._surface.points()
        whole = FilmIntegrator(everywhere, self.model, occluder=self._surface.occluder)
        whole.add(path)
        raw = whole.raw_um
        settled = after_film_effects(raw, self._settles, everywhere)
        return np.divide(settled, raw, out=np.ones(len(raw)), where=raw > 0.0)[self._rows]
