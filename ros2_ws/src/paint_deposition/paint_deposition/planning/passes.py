"""Planned passes: lines over the smoothed surface, the timed motion along them, and its moves."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from paint_deposition.motion.programmed import Move
from paint_deposition.motion.trajectory import ONLY_BRUSH, Trajectory
from paint_deposition.planning.sides import SurfaceMap

WAYPOINT_STEP_M = 0.01
# A robot program takes every so many waypoints: within 1 mm of a curve of 0.25 m radius.
WAYPOINTS_PER_MOVE = 4


@dataclass(frozen=True)
class PassStyle:
    """How passes are run."""

    standoff_m: float  # TCP to smoothed surface along the gun's axis [m]
    speed_m_per_s: float  # of the TCP while spraying [m/s]
    acceleration_m_per_s2: float = 2.0  # of the robot [m/s^2]
    overspray_m: float = 0.3  # the gun opens and closes this far outside the part [m]
    band_m: float = 0.15  # the part's ends are looked for this far to both sides of a pass [m]
    travel_rad: float = 0.0  # direction of the first pass in the tool's x-y frame [rad]
    one_way: bool = False  # every pass runs in the direction of the first
    brush: int = ONLY_BRUSH  # number of the brush that sprays; 0 is the only one

    @property
    def transfer_speed_m_per_s(self) -> float:
        """From a pass or a face to the next [m/s]."""
        return max(self.speed_m_per_s, 0.3)


@dataclass(frozen=True)
class PlannedPass:
    """One pass, from standstill to standstill."""

    across_m: float  # where its line lies [m]
    positions_m: np.ndarray  # (W, 3) TCP at waypoints, in running order
    rotations: np.ndarray  # (W, 3, 3) tool axes as columns
    along_m: np.ndarray  # (W,) travel of the TCP from the start
    # Travel at which the gun opens and closes.
    on_m: float
    off_m: float
    speed_m_per_s: float  # of the TCP while spraying [m/s]
    style: PassStyle  # of all passes of its face


def plan_pass(
    surface_map: SurfaceMap,
    across_m: float,
    style: PassStyle,
    backwards: bool = False,
    speed_m_per_s: float | None = None,
) -> PlannedPass:
    """The pass along a line: standoff and orientation follow the smoothed surface.

    The tool keeps its orientation about its axis whichever way the pass runs. Its speed is that
    of its style where none is given.
    """
    speed = speed_m_per_s or style.speed_m_per_s
    first, last = surface_map.extent_near_m(across_m, style.band_m)
    # With the gun off: from standstill to full speed, and some travel at that.
    lead = speed**2 / (2.0 * style.acceleration_m_per_s2) + 0.02
    beyond = style.overspray_m + lead
    count = max(2, math.ceil((last - first + 2.0 * beyond) / WAYPOINT_STEP_M) + 1)
    line = np.linspace(first - beyond, last + beyond, count)
    across = np.full(count, across_m)
    tool_z, travel = -surface_map.normals(line, across), surface_map.axes[0]
    way = travel - (tool_z @ travel)[:, np.newaxis] * tool_z
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    side = np.cross(tool_z, way)
    cos, sin = math.cos(style.travel_rad), math.sin(style.travel_rad)
    rotations = np.stack([cos * way - sin * side, sin * way + cos * side, tool_z], axis=2)
    positions = surface_map.places_m(line, across) - style.standoff_m * tool_z
    if backwards:
        line, positions, rotations = line[::-1], positions[::-1], rotations[::-1]
    step = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    along = np.append(0.0, np.cumsum(step))
    ends = np.array([first - style.overspray_m, last + style.overspray_m])
    order = 1.0 if not backwards else -1.0
    on, off = np.sort(np.interp(order * ends, order * line, along))
    return PlannedPass(
        float(across_m), np.ascontiguousarray(positions), np.ascontiguousarray(rotations), along,
        float(on), float(off), speed, style,
    )  # fmt: skip


def plan_passes(
    surface_map: SurfaceMap,
    lines_m: Sequence[float] | np.ndarray,
    style: PassStyle,
    speeds_m_per_s: Sequence[float] | None = None,
) -> tuple[PlannedPass, ...]:
    """Passes along lines in this order; every other one runs backwards, unless all run one way."""
    speeds = speeds_m_per_s or [style.speed_m_per_s] * len(lines_m)
    return tuple(
        plan_pass(surface_map, float(across), style, bool(number % 2) and not style.one_way, speed)
        for number, (across, speed) in enumerate(zip(lines_m, speeds, strict=True))
    )


def trajectory_of(
    passes: Sequence[PlannedPass], frame_id: str = '', rate_hz: float = 250.0
) -> Trajectory:
    """The timed motion: poses at an even rate, and the trigger.

    Every pass and every transfer between passes starts and ends at rest, with trapezoidal speed.
    """
    legs: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    triggers = []
    clock = 0.0
    for number, planned in enumerate(passes):
        if number:
            between, duration_s = _transfer(clock, passes[number - 1], planned, rate_hz)
            legs.append(between)
            clock += duration_s
        duration_s, travel_m, reached_s = _ramp(
            float(planned.along_m[-1]), planned.speed_m_per_s, planned.style
        )
        triggers += [clock + reached_s(planned.on_m), clock + reached_s(planned.off_m)]
        times = np.linspace(0.0, duration_s, max(2, math.ceil(duration_s * rate_hz) + 1))
        legs.append((clock + times, *_poses_at(planned, travel_m(times))))
        clock += duration_s
    stamps_s, positions_m, quaternions = map(np.concatenate, zip(*legs, strict=True))
    stamps_ns = np.round(stamps_s * 1e9).astype(np.int64)
    forward = np.append(True, np.diff(stamps_ns) > 0)
    return Trajectory(
        stamps_ns=stamps_ns[forward],
        positions_m=positions_m[forward],
        quaternions_xyzw=quaternions[forward],
        frame_id=frame_id,
        trigger_stamps_ns=np.round(np.array(triggers) * 1e9).astype(np.int64),
        trigger_flow=np.tile([1.0, 0.0], len(passes)),
        trigger_brush=np.repeat([planned.style.brush for planned in passes], 2),
    )


def planned_moves(passes: Sequence[PlannedPass]) -> list[Move]:
    """Straight moves for a robot program: lead-in, waypoints with the gun on, lead-out."""
    moves = []
    for planned in passes:
        inside = (planned.along_m > planned.on_m) & (planned.along_m < planned.off_m)
        between = planned.along_m[inside][WAYPOINTS_PER_MOVE::WAYPOINTS_PER_MOVE].tolist()
        stops = [0.0, planned.on_m, *between, planned.off_m, float(planned.along_m[-1])]
        positions, quaternions = _poses_at(planned, np.array(stops))
        for k, pose in enumerate(zip(positions, quaternions, strict=True)):
            speed = planned.speed_m_per_s if k else planned.style.transfer_speed_m_per_s
            spraying = 2 <= k < len(stops) - 1
            moves.append(Move(*pose, speed, spraying, brush=planned.style.brush))
    return moves


def _ramp(
    length_m: float, speed_m_per_s: float, style: PassStyle
) -> tuple[float, Callable[[np.ndarray], np.ndarray], Callable[[float], float]]:
    """Trapezoidal speed over a length of travel, from rest to rest.

    Returned are how long it takes, the travel at times from the start, and the time at a travel.
    """
    acceleration = style.acceleration_m_per_s2
    # A short travel does not reach full speed: the trapezoid is a triangle.
    speed = min(speed_m_per_s, math.sqrt(length_m * acceleration))
    rise_s = speed / acceleration
    duration_s = length_m / speed + rise_s if length_m > 0.0 else 0.0
    rise_m = 0.5 * speed * rise_s

    def travel_m(time_s: np.ndarray) -> np.ndarray:
        t = np.clip(time_s, 0.0, duration_s)
        left = duration_s - t
        rising, falling = 0.5 * acceleration * t**2, 0.5 * acceleration * left**2
        even = speed * (t - 0.5 * rise_s)
        return np.select([t < rise_s, left < rise_s], [rising, length_m - falling], even)

    def reached_s(way_m: float) -> float:
        if way_m < rise_m:
            return math.sqrt(2.0 * way_m / acceleration)
        if way_m > length_m - rise_m:
            return duration_s - math.sqrt(2.0 * (length_m - way_m) / acceleration)
        return 0.5 * rise_s + way_m / speed

    return duration_s, travel_m, reached_s


def _transfer(
    start_s: float, before: PlannedPass, after: PlannedPass, rate_hz: float
) -> tuple[tuple[np.ndarray, np.ndarray, np.ndarray], float]:
    """Straight from the end of a pass to the start of the next, turning evenly with the travel.

    Returned are times, positions and quaternions, and how long it takes.
    """
    start, end = before.positions_m[-1], after.positions_m[0]
    turn = Rotation.from_matrix(np.stack([before.rotations[-1], after.rotations[0]]))
    angle = float((turn[0].inv() * turn[1]).magnitude())
    length = float(np.linalg.norm(end - start))
    ramp_s, travel_m, _ = _ramp(length, after.style.transfer_speed_m_per_s, after.style)
    # Turn of the tool between passes is no faster than this.
    duration = max(ramp_s, angle / math.radians(90.0))
    if duration == 0.0:
        return (np.empty(0), np.empty((0, 3)), np.empty((0, 4))), 0.0
    times = np.linspace(0.0, duration, max(2, math.ceil(duration * rate_hz) + 1))
    share = times / duration
    if length > 0.0:
        share = travel_m(share * ramp_s) / length
    positions = start + share[:, np.newaxis] * (end - start)
    quaternions = Slerp([0.0, 1.0], turn)(share).as_quat()
    return (start_s + times, positions, quaternions), duration


def _poses_at(planned: PlannedPass, way_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    positions = np.stack(
        [np.interp(way_m, planned.along_m, planned.positions_m[:, k]) for k in range(3)], axis=1
    )
    turns = Slerp(planned.along_m, Rotation.from_matrix(planned.rotations))
    return positions, turns(np.clip(way_m, 0.0, planned.along_m[-1])).as_quat()
