"""Passes for a part: where they lie, how the gun runs along them, and the film that they lay."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.paint_used import NO_PAINT, PaintUsed, paint_figures
from paint_deposition.film.statistics import FilmStatistics, film_statistics
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.motion.programmed import Move
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.part.surface import Surface
from paint_deposition.planning.films import LineFilms, evenness, simulated
from paint_deposition.planning.passes import (
    PassStyle,
    PlannedPass,
    plan_passes,
    planned_moves,
    trajectory_of,
)
from paint_deposition.planning.placing import Placing, centred, place_passes
from paint_deposition.planning.plane_passes import passes_to_cover
from paint_deposition.planning.recommendation import Recommendation, recommend
from paint_deposition.planning.requests import PlanRequest
from paint_deposition.planning.surface_map import SurfaceMap, pass_axes

# Without a range the index is looked for about the one that is best on a plane.
INDEX_SHARES = (0.75, 1.25)
# The gun opens where the pattern begins to reach the part with all but this much of its volume.
OVERSPRAY_SHARE = 0.9
TARGET_ROUNDS = 4
TARGET_PRECISION = 2e-3


@dataclass(frozen=True)
class TradeOffPoint:
    """A result of one weight of the paint, as ``pareto.csv`` has it."""

    paint_weight: float
    sigma_n: float
    mean_um: float
    paint_cm3: float
    cycle_time_s: float
    passes: int


@dataclass(frozen=True)
class Plan:
    """Passes on a part with the film that the model predicts.

    Attributes:
        surface: the part. request: what was asked for. style: how passes are run.
        placing: number, index and place of the passes, with sigma_n of the search.
        passes: in running order. trajectory: their timed poses and trigger.
        film_um: (V,) film on the refined part. painted: (V,) bool, the side that is painted.
        statistics: of the film on the painted side.
        sigma_n: standard deviation over mean of the film on the painted side, bare metal
            included.
        plane: recommendation for a plane of the part's size.
        plane_on_part: its passes laid about the middle of this part.
        model: what the gun sprays.
        line_films: films of single passes, for other placings.
        moves: of a robot program along the passes.
        plain: of an optimised plan, the one that it began with; else None.
        paint: that is sprayed.
        cycle_time_s: from the first pose to the last.
    """

    surface: Surface
    request: PlanRequest
    style: PassStyle
    placing: Placing
    passes: tuple[PlannedPass, ...]
    trajectory: Trajectory
    film_um: np.ndarray
    painted: np.ndarray
    statistics: FilmStatistics
    sigma_n: float
    plane: Recommendation
    plane_on_part: Placing
    model: DepositionModel
    line_films: LineFilms
    moves: tuple[Move, ...]
    plain: 'Plan | None' = None
    paint: PaintUsed = NO_PAINT

    @property
    def mean_um(self) -> float:
        """Mean film on the painted side, bare metal included [um]."""
        area = self.surface.vertex_areas_m2[self.painted]
        return evenness(self.film_um[self.painted], area)[0]

    @property
    def cycle_time_s(self) -> float:
        """From the first pose to the last [s]."""
        return self.trajectory.duration_s

    @cached_property
    def path(self) -> SprayPath:
        """The motion cut into sub-steps."""
        return spray_path(self.trajectory)[0]

    @property
    def sentence(self) -> str:
        """The plan in a sentence."""
        speeds = f'{self.style.speed_m_per_s:.3g} m/s'
        if self.plain:
            sprayed = [move.speed_m_per_s for move in self.moves if move.spraying]
            speeds = f'{min(sprayed):.3g} to {max(sprayed):.3g} m/s'
        return (
            f'{self.placing.passes} {self.request.direction} passes at '
            f'{self.placing.index_m * 1e3:.0f} mm, {speeds}: mean film '
            f'{self.statistics.mean_um:.1f} µm, sigma_n {self.sigma_n * 100:.1f} %, '
            f'{self.cycle_time_s:.1f} s'
        )

    @property
    def comparison(self) -> str:
        """What the part's shape makes of passes for a plane, in a sentence."""
        return (
            f'on a plane: sigma_n {100 * self.plane.sigma_n:.1f} % at '
            f'{self.plane.index_m * 1e3:.0f} mm; those passes about the middle of this part: '
            f'{100 * self.plane_on_part.sigma_n:.1f} %'
        )

    def __repr__(self) -> str:
        return f'Plan({self.sentence})'

    @property
    def point(self) -> TradeOffPoint:
        """The plan in a trade-off."""
        return TradeOffPoint(
            self.request.paint_weight, self.sigma_n, self.mean_um,
            self.statistics.emitted_volume_cm3, self.cycle_time_s, self.placing.passes,
        )  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Figures of the plan."""
        return {
            'direction': self.request.direction,
            'passes': self.placing.passes,
            'index_m': self.placing.index_m,
            'lines_m': [planned.across_m for planned in self.passes],
            'standoffs_m': [planned.style.standoff_m for planned in self.passes],
            'leans_deg': [math.degrees(planned.style.lean_rad) for planned in self.passes],
            'travel': 'one_way' if self.request.one_way else 'alternating',
            'gun_turns': False,
            'speed_m_per_s': self.style.speed_m_per_s,
            'standoff_m': self.style.standoff_m,
            'overspray_m': self.style.overspray_m,
            'acceleration_m_per_s2': self.style.acceleration_m_per_s2,
            'smoothing_radius_m': self.request.smoothing_radius_m,
            'cycle_time_s': self.cycle_time_s,
            'sprayed_m': sum(planned.sprayed_m for planned in self.passes),
            'sigma_n': self.sigma_n,
            'film': self.statistics.to_dict(),
            'paint': paint_figures(self),
            'plain': self.plain
            and {
                **{k: v for k, v in vars(self.plain.point).items() if k != 'paint_weight'},
                'capture_fraction': self.plain.statistics.capture_fraction,
            },
            'plane': {
                'index_m': self.plane.index_m,
                'passes': self.plane_on_part.passes,
                'sigma_n': self.plane.sigma_n,
                'sigma_n_on_part': self.plane_on_part.sigma_n,
            },
        }


def plan(
    surface: Surface,
    model: DepositionModel,
    request: PlanRequest,
    frame_id: str = '',
    progress: Callable[[str, float], None] = lambda what, share: None,
) -> Plan:
    """Plan passes and simulate their film.

    Args:
        surface: the part. model: what the gun sprays.
        frame_id: frame of the poses.
        progress: called with what is done and its share, 0 to 1.

    Raises:
        PlanError: the request has no answer; says why and what comes closest.
    """
    axes = pass_axes(surface, request.direction, request.outward)
    surface_map = SurfaceMap(surface, axes, request.smoothing_radius_m)
    painted, area = surface_map.painted, surface.vertex_areas_m2[surface_map.painted]
    (left, right), ends = surface_map.extent_m.tolist()
    height = ends[1] - ends[0]
    plane = recommend(model, request.for_plane(height, right - left))
    index_range = _index_range(request, plane)
    style = _style(model, request, plane)
    films = LineFilms(
        surface, surface_map, model, style, plane.collapse.finest_m, 0.5 * plane.half_width_m,
        lambda share: progress('single passes', share),
    )  # fmt: skip
    placing = place_passes(films, ends, index_range, request.tolerance)
    count = passes_to_cover(plane.curve.parallel, plane.index_m, height)
    on_part = centred(films, ends, count, plane.index_m)
    # Level passes go from the top down, vertical ones from the left to the right.
    lines = placing.lines_m if request.direction == 'horizontal' else placing.lines_m[::-1]
    target = None if request.speed_m_per_s else request.target_um
    for round_ in range(TARGET_ROUNDS):
        passes = plan_passes(surface_map, lines, [style] * len(lines))
        trajectory = trajectory_of(passes, style, frame_id)
        film, paint = simulated(surface, model, trajectory, lambda share: progress('film', share))
        mean, sigma_n = evenness(film[painted], area)
        ratio = mean / target if target else 1.0
        if abs(ratio - 1.0) <= TARGET_PRECISION or round_ == TARGET_ROUNDS - 1:
            break
        style = replace(style, speed_m_per_s=style.speed_m_per_s * ratio)
    statistics = planned_statistics(film[painted], area, paint.emitted_cm3, request)
    return Plan(
        surface, request, style, placing, passes, trajectory, film, painted,
        statistics, sigma_n, plane, on_part, model, films, tuple(planned_moves(passes, style)),
        paint=paint,
    )  # fmt: skip


def _style(model: DepositionModel, request: PlanRequest, plane: Recommendation) -> PassStyle:
    overspray = request.overspray_m
    if overspray is None:
        distance = plane.setup.standoff_m + model.projection.emission_offset_m
        widening = distance / model.projection.model_plane_m
        radii = np.linspace(0.0, model.planar.radius_of_flux_m(1e-6), 500)
        enclosed = model.planar.enclosed_fraction(radii)
        overspray = widening * float(np.interp(OVERSPRAY_SHARE, enclosed, radii))
    return PassStyle(
        standoff_m=plane.setup.standoff_m,
        speed_m_per_s=plane.speed_m_per_s,
        acceleration_m_per_s2=request.acceleration_m_per_s2,
        overspray_m=overspray,
        band_m=0.25 * plane.half_width_m,
        travel_rad=request.travel_rad,
        one_way=request.one_way,
        brush=model.brush,
    )


def _index_range(request: PlanRequest, plane: Recommendation) -> tuple[float, float]:
    if request.index_m is not None:
        return request.index_m, request.index_m
    low, high = (share * plane.index_m for share in INDEX_SHARES)
    return request.index_min_m or low, request.index_max_m or high


def planned_statistics(
    film_um: np.ndarray, area_m2: np.ndarray, emitted_cm3: float, request: PlanRequest
) -> FilmStatistics:
    """Of a planned film; within a tenth of the target, if there is one, it is good."""
    target = request.target_um or 0.0
    return film_statistics(
        film_um, area_m2, emitted_cm3, target_um=target, target_tolerance_um=0.1 * target
    )
