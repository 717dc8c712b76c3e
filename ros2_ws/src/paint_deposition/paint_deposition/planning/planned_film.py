"""The film that a plan aims at, that of a planned motion, and where the gun comes too close."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import PaintError
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.film.statistics import (
    FilmStatistics,
    PaintUsed,
    film_statistics,
    paint_figures,
)
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.motion.programmed import Move
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.part.surface import Surface
from paint_deposition.part.zones import Zones
from paint_deposition.planning.driving import Drive
from paint_deposition.planning.joints import rows_apart
from paint_deposition.planning.passes import PlannedPass
from paint_deposition.planning.requests import GunEnvelope, PlanRequest

# Difference from the target, as a share of it, within which a film is good.
DEFAULT_TOLERANCE = 0.1
# Some of V points, (V,) bool, the film wanted there [um], and the share of it that is accepted
# either way; None: any film.
Band = tuple[np.ndarray, float, float | None]


@dataclass(frozen=True)
class WantedFilm:
    """The film wanted on a region of a part; a film over ``share`` should be the mean target."""

    region: np.ndarray  # (V,) bool, vertices whose film counts
    target_um: float | None  # mean target there; None: it is that of the film as it is
    elsewhere_um: float | None  # target outside of the zones, None: none
    share: np.ndarray  # (V,) target of each vertex over the mean target
    zones: Zones | None = None  # of the vertices
    free_m2: float = 0.0  # what is painted and has no target [m^2]

    @staticmethod
    def of(
        surface: Surface, region: np.ndarray, target_um: float | None, zones: Zones | None
    ) -> WantedFilm:
        """In zones their targets, and elsewhere ``target_um``, count on a region (V,) bool.

        Raises:
            PaintError: no vertex of the region has a target of its own.
        """
        if zones is None:
            return WantedFilm(region, target_um, target_um, np.ones(len(region)))
        targets, _ = zones.wanted_um(target_um)
        counted = region & ~np.isnan(targets)
        if not (counted & (zones.number >= 0)).any():
            raise PaintError(
                'no zone lies where paint is to land; give zones on the side that the gun faces'
            )
        # By zones, and not by vertices: of equal targets it is the very same.
        area = np.where(counted, surface.vertex_areas_m2, 0.0)
        kinds, of = np.unique(targets, return_inverse=True)
        areas = np.bincount(of, area)
        mean = float((areas / areas.sum())[areas > 0.0] @ kinds[areas > 0.0])
        return WantedFilm(
            counted, mean, target_um, np.where(counted, targets / mean, 1.0), zones,
            float(surface.vertex_areas_m2[region & ~counted].sum()),
        )  # fmt: skip

    def doubts(self, laid: FilmStatistics) -> Iterator[str]:
        """What of the film that is laid may not be as expected, a line each."""
        if self.free_m2:
            yield (
                f'{self.free_m2:.2g} m2 of what is painted are in no zone and have no target: any '
                'film is taken there; give --target-um, or a zone over them'
            )
        for one in self.zones.zones if self.zones else ():
            if one.name not in laid.zones:
                yield (
                    f'zone {one.name} is left out: the passes do not paint it, or hardly; give '
                    'passes over it'
                )
        for name, zone in laid.zones.items():
            low, high = zone.band_um
            if not low <= zone.mean_um <= high:
                yield (
                    f'zone {name}: the mean film is {zone.mean_um:.1f} µm, outside of {low:g} to '
                    f'{high:g} µm: the passes over it reach its neighbours too; lay passes along '
                    'the border, or allow other speeds (--speed-min, --speed-max)'
                )

    def bands(self, rows: np.ndarray, target_um: float, tolerance: float | None) -> list[Band]:
        """Films accepted at vertices (V,), outside of zones by the target and tolerance given."""
        if self.zones is None:
            return [(np.ones(len(rows), dtype=bool), target_um, tolerance)]
        here = self.zones.select(rows)
        found: list[Band] = [
            (own, zone.target_um, zone.tolerance_um / zone.target_um) for zone, own in here
        ]
        if self.elsewhere_um is not None:
            found.append((here.number < 0, self.elsewhere_um, tolerance))
        return found


def simulated(
    surface: Surface,
    model: DepositionModel,
    trajectory: Trajectory,
    progress: Callable[[float], None] = lambda share: None,
) -> tuple[np.ndarray, PaintUsed]:
    """(V,) film of a motion [um], and what it sprays."""
    path, _ = spray_path(trajectory, max_step_m=model.max_step_m)
    integrator = FilmIntegrator(surface.points(), model, occluder=surface)
    integrator.add(path, lambda done: progress(done / len(path)))
    return integrator.film_um, integrator.used


@dataclass(frozen=True)
class LaidFilm:
    """The film that a motion lays on a part, and the paint and time spent on it.

    Mean, evenness and share within the tolerance are by area, bare metal included.
    """

    trajectory: Trajectory  # timed poses and trigger
    film_um: np.ndarray  # (V,) at the vertices of the surface
    paint: PaintUsed
    statistics: FilmStatistics  # of the film where one is wanted, with those of its zones
    whole_part: FilmStatistics  # of the film on the whole part
    mean_um: float  # where a film is wanted
    sigma_n: float  # standard deviation over mean there, of the film over its own target
    within: float  # share of the area there within the tolerance
    tolerance: float  # difference from the target that is accepted, as a share of it

    @staticmethod
    def of(
        surface: Surface,
        wanted: WantedFilm,
        trajectory: Trajectory,
        film_um: np.ndarray,
        paint: PaintUsed,
        tolerance: float = DEFAULT_TOLERANCE,
    ) -> LaidFilm:
        """Summarise a film (V,) [um]; outside of zones the target and the tolerance hold."""
        region, target_um = wanted.region, wanted.elsewhere_um or 0.0
        statistics, whole_part = (
            film_statistics(
                film_um[rows], surface.vertex_areas_m2[rows], paint.emitted_cm3,
                target_um=target_um, target_tolerance_um=tolerance * target_um,
                zones=wanted.zones and wanted.zones.select(rows),
            )
            for rows in (region, np.ones_like(region))
        )  # fmt: skip
        film, area = film_um[region], surface.vertex_areas_m2[region]
        good = np.zeros(len(film), dtype=bool)
        for points, target, share in wanted.bands(np.flatnonzero(region), target_um, tolerance):
            off = share or 0.0
            good |= points & (film >= target * (1.0 - off)) & (film <= target * (1.0 + off))
        return LaidFilm(
            trajectory, film_um, paint, statistics, whole_part, evenness(film, area)[0],
            evenness(film / wanted.share[region], area)[1], float(area[good].sum() / area.sum()),
            tolerance,
        )  # fmt: skip

    @cached_property
    def path(self) -> SprayPath:
        """The motion cut into sub-steps."""
        return spray_path(self.trajectory)[0]

    @property
    def cycle_time_s(self) -> float:
        """From the first pose to the last [s]."""
        return self.trajectory.duration_s


@dataclass(frozen=True)
class Contact:
    """The part within the envelope for a while."""

    # Since the first pose.
    begin_s: float
    end_s: float
    place_m: np.ndarray  # (3,) of the part that is deepest inside [m]
    depth_m: float  # how far it is inside [m]
    by_gun: bool  # whether it meets the gun, not only the cylinder before it

    def __str__(self) -> str:
        where = ', '.join(f'{value:.3f}' for value in self.place_m)
        what = 'the gun touches the part' if self.by_gun else 'the part is too near before the gun'
        return (
            f'{what} at ({where}) m from {self.begin_s:.1f} to {self.end_s:.1f} s, by '
            f'{self.depth_m * 1e3:.0f} mm'
        )


def contacts(
    surface: Surface, trajectory: Trajectory, envelope: GunEnvelope
) -> tuple[Contact, ...]:
    """Where the envelope meets the part, by the vertices of its refined mesh.

    What is smaller than an edge of that mesh may be missed by half an edge.
    """
    turns = Rotation.from_quat(trajectory.quaternions_xyzw)
    rows = rows_apart(trajectory.positions_m, turns, 0.01, math.radians(2.0))
    positions, axes = trajectory.positions_m[rows], turns[rows].as_matrix()[:, :, 2]
    # The spheres that hold gun and cylinder, about the middle of both.
    whole_m = envelope.before_m + envelope.length_m
    near = cKDTree(surface.vertices_m).query_ball_point(
        positions + (envelope.before_m - 0.5 * whole_m) * axes,
        math.hypot(envelope.radius_m, 0.5 * whole_m),
    )
    seconds = 1e-9 * (trajectory.stamps_ns[rows] - trajectory.stamps_ns[0])
    found: list[Contact] = []
    for time_s, position, axis, vertices in zip(seconds, positions, axes, near, strict=True):
        if not vertices:
            continue
        way = surface.vertices_m[vertices] - position
        along = way @ axis
        aside = np.linalg.norm(way - along[:, np.newaxis] * axis, axis=1)
        depth = np.minimum.reduce(
            [envelope.radius_m - aside, envelope.before_m - along, along + envelope.length_m]
        )
        deepest = int(np.argmax(depth))
        if depth[deepest] <= 0.0:
            continue
        by_gun = bool(((depth > 0.0) & (along < 0.0)).any())
        here = Contact(
            float(time_s), float(time_s), surface.vertices_m[vertices[deepest]],
            float(depth[deepest]), by_gun,
        )  # fmt: skip
        # Contacts closer together in time than this are one.
        if found and time_s - found[-1].end_s < 0.5:
            before = found[-1]
            deeper = max(before, here, key=lambda contact: contact.depth_m)
            by_gun = before.by_gun or here.by_gun
            found[-1] = replace(deeper, begin_s=before.begin_s, end_s=here.end_s, by_gun=by_gun)
        else:
            found.append(here)
    return tuple(found)


@dataclass(frozen=True, kw_only=True)
class PlannedFilm(LaidFilm):
    """Passes on a part with the film that the model predicts."""

    surface: Surface
    model: DepositionModel
    request: PlanRequest
    wanted: WantedFilm  # on the side or the faces that are painted
    passes: tuple[PlannedPass, ...]  # in running order
    moves: tuple[Move, ...]  # of a robot program along them
    drive: Drive | None = None  # of the robot that it was made for
    contacts: tuple[Contact, ...] = ()  # where gun or spray come too close to the part
    envelope: GunEnvelope = field(default_factory=GunEnvelope)  # of the gun

    @property
    def region(self) -> str:
        """Where its figures are taken, in words."""
        area_m2 = self.surface.vertex_areas_m2[self.wanted.region].sum()
        return f'the {area_m2:.2f} of {self.surface.area_m2:.2f} m2 to be painted'

    @property
    def sprayed_speeds_m_per_s(self) -> list[float]:
        """Speeds of the moves that spray."""
        return [move.speed_m_per_s for move in self.moves if move.spraying]

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
        slowed = bool(self.drive and self.drive.limits)
        # A mean film this close to the target is on it; speeds this close to a limit keep it.
        near = 0.01
        yield from self.drive.limits if self.drive else ()
        yield from map(str, self.contacts)
        yield from self.wanted.doubts(self.statistics)
        if target and not self.wanted.zones and abs(self.mean_um / target - 1.0) > near:
            if request.speed_m_per_s and not request.optimise:
                cause, remedy = 'at the speed given ', 'leave it out: it is chosen for the target'
            elif slowed:
                cause = 'with the passes that the joints slow down '
                remedy = (
                    'let the part stand elsewhere, paint place shows where, or give a lower '
                    '--speed-max with --optimise'
                )
            elif request.optimise:
                cause, remedy = '', 'allow other speeds (--speed-min, --speed-max)'
            else:
                cause, remedy = '', 'give a target nearer to it, or another index'
            yield (
                f'{cause}the mean film will be {self.mean_um:.1f} µm, not the target of '
                f'{target:g} µm; {remedy}'
            )
        slowest, fastest = min(self.sprayed_speeds_m_per_s), max(self.sprayed_speeds_m_per_s)
        least, most = request.speed_min_m_per_s, request.speed_max_m_per_s
        outside = slowest < (1.0 - near) * least or fastest > (1.0 + near) * most
        if outside and (slowed or not request.optimise):  # which keeps them
            yield (
                f'the passes run at {slowest:.3g} to {fastest:.3g} m/s, where {least:g} to '
                f'{most:g} m/s are allowed (--speed-min, --speed-max)'
            )

    def __repr__(self) -> str:
        return f'{type(self).__name__}({self.sentence})'

    def to_dict(self) -> dict[str, Any]:
        """Figures of the plan."""
        # Of each pass with the gun open: travel, and how long it takes.
        sprayed = self.path.select(self.path.flow > 0.0)
        _, number = np.unique(sprayed.spray_pass, return_inverse=True)
        travel_m = np.bincount(number, sprayed.dwell_s * sprayed.speed_m_per_s)
        seconds = np.bincount(number, sprayed.dwell_s)
        return {
            'direction': self.request.direction,
            'passes': len(self.passes),
            'cycle_time_s': self.cycle_time_s,
            'sprayed_m': float(travel_m.sum()),
            'speed_m_per_s': float(travel_m.sum() / seconds.sum()),
            'speeds_m_per_s': (travel_m / seconds).tolist(),
            'sigma_n': self.sigma_n,
            'region': self.region,
            'film': self.statistics.to_dict(),
            'whole_part': self.whole_part.to_dict(),
            'paint': paint_figures(self.model, self.paint, self.statistics),
            'gun': self.envelope.model_dump(),
            'contacts': [{**vars(one), 'place_m': one.place_m.tolist()} for one in self.contacts],
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
    """Rows that stand for equal shares of the area, 1500 at most."""
    reached = np.cumsum(area_m2)
    count = min(1500, 4 * len(area_m2))
    shares = (np.arange(count) + 0.5) / count * reached[-1]
    return np.searchsorted(reached, shares)
