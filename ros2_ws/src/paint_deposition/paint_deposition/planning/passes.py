"""Planned passes: lines over the smoothed surface, and the tool poses along them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from paint_deposition.errors import PlanError, require_above_zero
from paint_deposition.motion.trigger import ONLY_BRUSH
from paint_deposition.planning.surface_map import SurfaceMap

WAYPOINT_STEP_M = 0.01
# Travel at full speed before the gun opens and after it closes.
SETTLING_M = 0.02


@dataclass(frozen=True)
class PassStyle:
    """How passes are run.

    Attributes:
        standoff_m: TCP to smoothed surface along the gun's axis [m].
        speed_m_per_s: of the TCP while spraying [m/s].
        acceleration_m_per_s2: of the robot [m/s^2].
        overspray_m: the gun opens and closes this far outside the part [m].
        band_m: the part's ends are looked for this far to both sides of a pass [m].
        travel_rad: direction of the first pass in the tool's x-y frame [rad].
        one_way: every pass runs in the direction of the first.
        lean_rad: of the gun, turned about the line of its pass; above 0 the spray points to
            greater coordinates across [rad].
        brush: number of the brush that sprays; 0 is the only one.
    """

    standoff_m: float
    speed_m_per_s: float
    acceleration_m_per_s2: float = 2.0
    overspray_m: float = 0.3
    band_m: float = 0.15
    travel_rad: float = 0.0
    one_way: bool = False
    lean_rad: float = 0.0
    brush: int = ONLY_BRUSH

    def __post_init__(self) -> None:
        require_above_zero(
            standoff_m=self.standoff_m,
            speed_m_per_s=self.speed_m_per_s,
            acceleration_m_per_s2=self.acceleration_m_per_s2,
        )
        for name in ('overspray_m', 'band_m'):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise PlanError(f'{name} is {value:g}; give 0 or more')

    @property
    def lead_m(self) -> float:
        """Travel from standstill to full speed, with the gun off [m]."""
        return self.speed_m_per_s**2 / (2.0 * self.acceleration_m_per_s2) + SETTLING_M


@dataclass(frozen=True)
class PlannedPass:
    """One pass, from standstill to standstill.

    Attributes:
        across_m: where its line lies [m].
        positions_m: (W, 3) TCP at waypoints, in running order.
        rotations: (W, 3, 3) tool axes as columns.
        along_m: (W,) travel of the TCP from the start.
        on_m, off_m: travel at which the gun opens and closes.
        style: how it is run.
    """

    across_m: float
    positions_m: np.ndarray
    rotations: np.ndarray
    along_m: np.ndarray
    on_m: float
    off_m: float
    style: PassStyle

    @property
    def speed_m_per_s(self) -> float:
        """While spraying [m/s]."""
        return self.style.speed_m_per_s

    @property
    def sprayed_m(self) -> float:
        """Travel with the gun on [m]."""
        return self.off_m - self.on_m


def plan_pass(
    surface_map: SurfaceMap, across_m: float, style: PassStyle, backwards: bool = False
) -> PlannedPass:
    """The pass along a line: standoff and orientation follow the smoothed surface.

    The tool keeps its orientation about its axis whichever way the pass runs.
    """
    first, last = surface_map.extent_near_m(across_m, style.band_m)
    beyond = style.overspray_m + style.lead_m
    count = max(2, math.ceil((last - first + 2.0 * beyond) / WAYPOINT_STEP_M) + 1)
    line = np.linspace(first - beyond, last + beyond, count)
    positions, rotations = tool_poses(surface_map, line, np.full(count, across_m), style)
    if backwards:
        line, positions, rotations = line[::-1], positions[::-1], rotations[::-1]
    step = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(step)])
    ends = np.array([first - style.overspray_m, last + style.overspray_m])
    order = 1.0 if not backwards else -1.0
    on, off = np.sort(np.interp(order * ends, order * line, along))
    return PlannedPass(
        float(across_m),
        np.ascontiguousarray(positions),
        np.ascontiguousarray(rotations),
        along,
        float(on),
        float(off),
        style,
    )


def tool_poses(
    surface_map: SurfaceMap, travel_m: np.ndarray, across_m: np.ndarray, style: PassStyle
) -> tuple[np.ndarray, np.ndarray]:
    """TCP (N, 3) [m] and tool axes (N, 3, 3), at standoff and lean over the smoothed surface."""
    axes = surface_map.axes
    normals = surface_map.normals(travel_m, across_m)
    height = surface_map.height_m(travel_m, across_m)
    on_surface = axes.points_m(np.stack([travel_m, across_m, height], axis=1))
    tool_z = -normals
    way = axes.travel - (tool_z @ axes.travel)[:, np.newaxis] * tool_z
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    side = np.cross(tool_z, way)
    cos, sin = math.cos(style.lean_rad), math.sin(style.lean_rad)
    tool_z, side = cos * tool_z + sin * side, cos * side - sin * tool_z
    cos, sin = math.cos(style.travel_rad), math.sin(style.travel_rad)
    rotations = np.stack([cos * way - sin * side, sin * way + cos * side, tool_z], axis=2)
    return on_surface - style.standoff_m * tool_z, rotations


def plan_passes(
    surface_map: SurfaceMap, lines_m: np.ndarray, styles: Sequence[PassStyle]
) -> tuple[PlannedPass, ...]:
    """Passes along lines in this order, each in its style.

    Every other one runs backwards, unless all run one way.
    """
    return tuple(
        plan_pass(
            surface_map, float(across), style, backwards=bool(number % 2) and not style.one_way
        )
        for number, (across, style) in enumerate(zip(lines_m, styles, strict=True))
    )
