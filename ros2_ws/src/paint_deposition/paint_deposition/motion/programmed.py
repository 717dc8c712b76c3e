"""Programmed moves of the TCP as a timed motion."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from operator import itemgetter

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from paint_deposition.errors import RecordingError
from paint_deposition.motion.trajectory import ONLY_BRUSH, Trajectory
from paint_deposition.request import POSE_FORMAT, is_pose

# A programme that runs longer loops where it should not.
LONGEST_S = 8 * 3600.0
PROGRAMMED = 'this is the motion as programmed, not as recorded'


@dataclass(frozen=True)
class GunSwitch:
    """The gun switched during a move, so far after its start or before its end."""

    distance_m: float
    from_start: bool
    on: bool
    brush: int | None = None  # the one that it changes to, None: as before

    def __str__(self) -> str:
        place = 'after its start' if self.from_start else 'before its end'
        return f'{"on" if self.on else "off"} {self.distance_m:g} m {place}'


@dataclass(frozen=True)
class Move:
    """A move to a pose of the TCP as programmed; on the robot, zones cut its corners."""

    position_m: np.ndarray  # (3,) TCP at the end of the move, in its frame [m]
    quaternion_xyzw: np.ndarray  # (4,) orientation of the tool there, scalar last
    speed_m_per_s: float
    spraying: bool  # whether the gun is on as the move begins
    # (3,) point that a circular move passes through, None for straight ones.
    via_m: np.ndarray | None = None
    switches: tuple[GunSwitch, ...] = ()  # of the gun during the move, in the order written
    line: int = 0  # where it stands in its file, 0 for none
    flow: float = 1.0  # of the gun while it is on, relative to the calibrated one
    brush: int = ONLY_BRUSH  # its number while it is on; 0 is the only one
    wait_s: float = 0.0  # how long it takes at least
    # Of a RAPID program: the instruction in lower case, the radius in which the corner is cut, 0:
    # stop, and the names of tool and work object.
    instruction: str = ''
    zone_m: float = 0.0
    tool: str = ''
    work_object: str = ''
    # That of the work object if the modules do not define it, or of the mechanical unit that
    # moves it; '' for the world.
    frame: str = ''


def timed(moves: Sequence[Move], gun_known: bool) -> Trajectory:
    """Poses along moves, from the end of the first on, at the programmed speeds.

    Where the gun is not known from the moves it sprays throughout. Raises RecordingError without a
    second move, and naming the line of one without a pose or a speed.
    """
    if len(moves) < 2:
        raise RecordingError('there is a single move; give a program that travels')
    for move in moves:
        if not is_pose(pose := [*map(float, move.position_m), *map(float, move.quaternion_xyzw)]):
            words = ' '.join(f'{value:g}' for value in pose)
            raise RecordingError(f'line {move.line}: {words} is no pose; give {POSE_FORMAT}')
    first = moves[0]
    times_s, positions, quaternions = [0.0], [first.position_m], [first.quaternion_xyzw]
    changes: list[tuple[float, float, int]] = []
    for before, move in pairwise(moves):
        if not 0.0 < move.speed_m_per_s < math.inf:
            raise RecordingError(f'line {move.line}: speed {move.speed_m_per_s:g} m/s; give one')
        turn = Rotation.from_quat([before.quaternion_xyzw, move.quaternion_xyzw])
        length_m, place_at = track(before.position_m, move.via_m, move.position_m)
        angle_rad = (turn[0].inv() * turn[1]).magnitude()
        # What ABB's predefined speeds allow the tool to turn, for moves that only turn it.
        duration_s = max(
            length_m / move.speed_m_per_s, angle_rad / math.radians(500.0), move.wait_s
        )
        # No move of a paint cell takes longer; one that does has a wrong number in it.
        if duration_s > 3600.0:
            raise RecordingError(
                f'line {move.line}: a move of {length_m:g} m at {move.speed_m_per_s:g} m/s takes '
                f'{duration_s / 3600.0:.3g} h; check its target and speed'
            )
        if times_s[-1] > LONGEST_S:
            raise RecordingError(
                f'line {move.line}: the program runs for over {LONGEST_S / 3600.0:g} h; check its '
                'loops and speeds'
            )
        switches = [
            (share, one.on, move.brush if one.brush is None else one.brush)
            for share, one in in_order(move.switches, length_m)
        ]
        changes += [
            (times_s[-1] + at * duration_s, on * move.flow, brush)
            for at, on, brush in [(0.0, move.spraying, move.brush), *switches]
        ]
        count = math.ceil(duration_s / 0.02)  # a pose every 20 ms
        share = np.arange(1, count + 1) / max(count, 1)
        positions += list(place_at(share))
        quaternions += list(Slerp([0.0, 1.0], turn)(share).as_quat()) if count else []
        times_s += (times_s[-1] + share * duration_s).tolist()
    gun: dict[int, tuple[float, int]] = {}
    if gun_known or any(flow for _, flow, _ in changes):
        gun = {round(time_s * 1e9): (float(now), brush) for time_s, now, brush in changes}
    gun = dict(sorted(gun.items()))
    return Trajectory(
        np.array([round(time_s * 1e9) for time_s in times_s]), np.array(positions),
        np.array(quaternions), trigger_stamps_ns=np.array([*gun], dtype=np.int64),
        trigger_flow=np.array([flow for flow, _ in gun.values()]),
        trigger_brush=np.array([brush for _, brush in gun.values()], np.int64),
    )  # fmt: skip


def in_order(switches: Sequence[GunSwitch], length_m: float) -> list[tuple[float, GunSwitch]]:
    """The switches of a move of this length as they happen, each with its share of the move."""
    at_m = [one.distance_m if one.from_start else length_m - one.distance_m for one in switches]
    shares = [min(max(at / length_m, 0.0), 1.0) if length_m > 0.0 else 0.0 for at in at_m]
    return sorted(zip(shares, switches, strict=True), key=itemgetter(0))


def track(
    begin_m: np.ndarray, via_m: np.ndarray | None, end_m: np.ndarray
) -> tuple[float, Callable]:
    """Length of a move [m], and a function from shares (N,) of it to places (N, 3) [m].

    A circular move, which has a ``via_m`` (3,), is straight where that lies on a line with begin
    and end.
    """
    to_end = end_m - begin_m
    to_via = np.zeros(3) if via_m is None else via_m - begin_m
    normal = np.cross(to_via, to_end)
    square = normal @ normal
    if square <= 1e-12 * (to_via @ to_via) * (to_end @ to_end):
        return float(np.linalg.norm(to_end)), lambda share: begin_m + np.outer(share, to_end)
    to_centre = np.cross(normal, to_via) * (to_end @ to_end)
    to_centre = (to_centre + np.cross(to_end, normal) * (to_via @ to_via)) / (2.0 * square)
    centre, radius = begin_m + to_centre, -to_centre
    along = np.cross(normal, radius) / math.sqrt(square)
    end = to_end - to_centre
    angle_rad = math.atan2(end @ along, end @ radius) % (2.0 * math.pi)

    def place_at(share: np.ndarray) -> np.ndarray:
        from_centre = np.outer(np.cos(share * angle_rad), radius)
        return centre + from_centre + np.outer(np.sin(share * angle_rad), along)

    return float(np.linalg.norm(radius)) * angle_rad, place_at
