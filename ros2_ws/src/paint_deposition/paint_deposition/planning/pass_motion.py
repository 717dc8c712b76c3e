"""The timed motion along planned passes, and the same as moves of a robot program."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from paint_deposition.motion.programmed import Move
from paint_deposition.motion.trajectory import Trajectory, numbered
from paint_deposition.planning.passes import PassStyle, PlannedPass

# A robot program takes every so many waypoints: within 1 mm of a curve of 0.25 m radius.
WAYPOINTS_PER_MOVE = 4
POSE_RATE_HZ = 250.0
LEAST_TRANSFER_SPEED_M_PER_S = 0.3
# Turn of the tool between passes is no faster than this.
TURN_RATE_RAD_PER_S = math.radians(90.0)


def trajectory_of(
    passes: tuple[PlannedPass, ...],
    style: PassStyle,
    frame_id: str = '',
    rate_hz: float = POSE_RATE_HZ,
) -> Trajectory:
    """The timed motion: poses at an even rate, and the trigger.

    Every pass and every transfer between passes starts and ends at rest, with trapezoidal speed.
    """
    legs: list[_Leg] = []
    triggers = []
    clock = 0.0
    for number, planned in enumerate(passes):
        if number:
            legs.append(_transfer(clock, passes[number - 1], planned, style, rate_hz))
            clock += legs[-1].duration_s
        ramp = _Ramp(float(planned.along_m[-1]), planned.speed_m_per_s, style)
        triggers += [clock + ramp.time_at_s(planned.on_m), clock + ramp.time_at_s(planned.off_m)]
        times = _sample_times(ramp.duration_s, rate_hz)
        poses = _poses_at(planned, ramp.way_at_m(times))
        legs.append(_Leg(clock + times, *poses, ramp.duration_s))
        clock += ramp.duration_s
    stamps_s = np.concatenate([leg.stamps_s for leg in legs])
    stamps_ns = np.round(stamps_s * 1e9).astype(np.int64)
    forward = np.append(True, np.diff(stamps_ns) > 0)
    return Trajectory(
        stamps_ns=stamps_ns[forward],
        positions_m=np.concatenate([leg.positions_m for leg in legs])[forward],
        quaternions_xyzw=np.concatenate([leg.quaternions for leg in legs])[forward],
        frame_id=frame_id,
        trigger_stamps_ns=np.round(np.array(triggers) * 1e9).astype(np.int64),
        trigger_flow=np.tile([1.0, 0.0], len(passes)),
        trigger_brush=numbered([style.brush] * (2 * len(passes))),
    )


def planned_moves(passes: tuple[PlannedPass, ...], style: PassStyle) -> list[Move]:
    """Straight moves for a robot program: lead-in, waypoints with the gun on, lead-out."""
    moves = []
    for planned in passes:
        inside = (planned.along_m > planned.on_m) & (planned.along_m < planned.off_m)
        between = planned.along_m[inside][WAYPOINTS_PER_MOVE::WAYPOINTS_PER_MOVE].tolist()
        stops = [0.0, planned.on_m, *between, planned.off_m, float(planned.along_m[-1])]
        positions, quaternions = _poses_at(planned, np.array(stops))
        for k, pose in enumerate(zip(positions, quaternions, strict=True)):
            speed = planned.speed_m_per_s if k else _transfer_speed(style)
            spraying = 2 <= k < len(stops) - 1
            moves.append(Move(*pose, speed, spraying, brush=style.brush))
    return moves


@dataclass(frozen=True)
class _Leg:
    """A timed stretch: samples with their times, and how long it takes."""

    stamps_s: np.ndarray
    positions_m: np.ndarray
    quaternions: np.ndarray
    duration_s: float


class _Ramp:
    """Trapezoidal speed over a length of travel, from rest to rest."""

    def __init__(self, length_m: float, speed_m_per_s: float, style: PassStyle) -> None:
        self.length = length_m
        self.acceleration = style.acceleration_m_per_s2
        # A short travel does not reach full speed: the trapezoid is a triangle.
        self.speed = min(speed_m_per_s, math.sqrt(length_m * self.acceleration))
        self.rise_s = self.speed / self.acceleration
        self.duration_s = length_m / self.speed + self.rise_s if length_m > 0.0 else 0.0

    def way_at_m(self, time_s: np.ndarray) -> np.ndarray:
        """Travel at times from the start."""
        t = np.clip(time_s, 0.0, self.duration_s)
        left = self.duration_s - t
        even = self.speed * (t - 0.5 * self.rise_s)
        rising, falling = 0.5 * self.acceleration * t**2, 0.5 * self.acceleration * left**2
        return np.select(
            [t < self.rise_s, left < self.rise_s], [rising, self.length - falling], even
        )

    def time_at_s(self, way_m: float) -> float:
        """When a travel is reached."""
        rise_m = 0.5 * self.speed * self.rise_s
        if way_m < rise_m:
            return math.sqrt(2.0 * way_m / self.acceleration)
        if way_m > self.length - rise_m:
            return self.duration_s - math.sqrt(2.0 * (self.length - way_m) / self.acceleration)
        return 0.5 * self.rise_s + way_m / self.speed


def _transfer(
    start_s: float, before: PlannedPass, after: PlannedPass, style: PassStyle, rate_hz: float
) -> _Leg:
    """Straight from the end of a pass to the start of the next, turning evenly with the travel."""
    start, end = before.positions_m[-1], after.positions_m[0]
    turn = Rotation.from_matrix(np.stack([before.rotations[-1], after.rotations[0]]))
    angle = float((turn[0].inv() * turn[1]).magnitude())
    length = float(np.linalg.norm(end - start))
    ramp = _Ramp(length, _transfer_speed(style), style)
    duration = max(ramp.duration_s, angle / TURN_RATE_RAD_PER_S)
    if duration == 0.0:
        return _Leg(np.empty(0), np.empty((0, 3)), np.empty((0, 4)), 0.0)
    times = _sample_times(duration, rate_hz)
    share = times / duration
    if length > 0.0:
        share = ramp.way_at_m(share * ramp.duration_s) / length
    positions = start + share[:, np.newaxis] * (end - start)
    quaternions = Slerp([0.0, 1.0], turn)(share).as_quat()
    return _Leg(start_s + times, positions, quaternions, duration)


def _transfer_speed(style: PassStyle) -> float:
    return max(style.speed_m_per_s, LEAST_TRANSFER_SPEED_M_PER_S)


def _poses_at(planned: PlannedPass, way_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    positions = np.stack(
        [np.interp(way_m, planned.along_m, planned.positions_m[:, k]) for k in range(3)], axis=1
    )
    turns = Slerp(planned.along_m, Rotation.from_matrix(planned.rotations))
    return positions, turns(np.clip(way_m, 0.0, planned.along_m[-1])).as_quat()


def _sample_times(duration_s: float, rate_hz: float) -> np.ndarray:
    """Times at about this rate, both ends included."""
    count = max(2, math.ceil(duration_s * rate_hz) + 1)
    return np.linspace(0.0, duration_s, count)
