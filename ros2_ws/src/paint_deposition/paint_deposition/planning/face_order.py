"""The order in which the faces of a part are sprayed, and the way from one to the next."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, permutations, product

import numpy as np
from scipy.spatial.transform import Rotation

from paint_deposition.motion.programmed import Move, timed
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.planning.pass_motion import (
    LEAST_TRANSFER_SPEED_M_PER_S,
    planned_moves,
    trajectory_of,
)
from paint_deposition.planning.passes import PassStyle, PlannedPass

# All orders are tried for so many faces; of more, each time the nearest is next.
MOST_TRIED = 6
# Between faces the gun is drawn back so far [m], by the first that keeps it clear of the part.
RETREATS_M = (0.1, 0.2, 0.4, 0.8)


@dataclass(frozen=True)
class FacePasses:
    """The passes of one face in running order, and how they are run."""

    passes: tuple[PlannedPass, ...]
    style: PassStyle

    @property
    def start_m(self) -> np.ndarray:
        """(3,) TCP at the start of the first pass [m]."""
        return self.passes[0].positions_m[0]

    @property
    def end_m(self) -> np.ndarray:
        """(3,) TCP at the end of the last pass [m]."""
        return self.passes[-1].positions_m[-1]

    def reversed(self) -> 'FacePasses':
        """The same passes the other way round, the last one first."""
        return replace(self, passes=tuple(map(_reversed, self.passes[::-1])))


def in_order(faces: Sequence[FacePasses]) -> tuple[FacePasses, ...]:
    """The faces with least travel between them; a face may run the other way round.

    Faces whose passes all run one way are not turned.
    """
    if len(faces) > MOST_TRIED:
        return _nearest_next(faces)
    ways = [(f,) if f.style.one_way else (f, f.reversed()) for f in faces]
    tried = (
        tuple(either[k] for k in order)
        for either in product(*ways)
        for order in permutations(range(len(faces)))
    )
    return min(tried, key=_travel_m)


@dataclass(frozen=True)
class Motion:
    """The whole motion: timed, and as moves of a robot program."""

    trajectory: Trajectory
    moves: tuple[Move, ...]


def motion_over(
    faces: Sequence[FacePasses], frame_id: str, is_clear: Callable[[Trajectory], bool]
) -> Motion:
    """Spray the faces one after the other; the gun is drawn back along its axis between them.

    Args:
        faces: in running order.
        frame_id: of the poses.
        is_clear: whether a way from face to face keeps clear of the part.
    """
    parts: list[Trajectory] = []
    moves: list[Move] = []
    for number, face in enumerate(faces):
        own = planned_moves(face.passes, face.style)
        if number:
            between = _between(moves[-1], own[0], face.style, is_clear)
            parts.append(timed([moves[-1], *between, own[0]], gun_known=False))
            moves += between
        parts.append(trajectory_of(face.passes, face.style, frame_id))
        moves += own
    return Motion(_joined(parts, frame_id), tuple(moves))


def _between(
    before: Move, after: Move, style: PassStyle, is_clear: Callable[[Trajectory], bool]
) -> list[Move]:
    """Moves from the end of a face to the start of the next, without both."""
    speed = max(style.speed_m_per_s, LEAST_TRANSFER_SPEED_M_PER_S)
    for retreat_m in RETREATS_M:
        between = [
            Move(_drawn_back(move, retreat_m), move.quaternion_xyzw, speed, spraying=False)
            for move in (before, after)
        ]
        if is_clear(timed([before, *between, replace(after, speed_m_per_s=speed)], False)):
            break
    return between


def _drawn_back(move: Move, by_m: float) -> np.ndarray:
    return move.position_m - by_m * Rotation.from_quat(move.quaternion_xyzw).as_matrix()[:, 2]


def _joined(parts: Sequence[Trajectory], frame_id: str) -> Trajectory:
    """One motion after the other; each begins where the one before ends."""
    clock, shifts = 0, []
    for part in parts:
        shifts.append(clock - int(part.stamps_ns[0]))
        clock += int(part.stamps_ns[-1] - part.stamps_ns[0])

    def rows(name: str, number: int) -> np.ndarray:
        # Where one ends and the next begins there is one pose.
        return getattr(parts[number], name)[1 if number else 0 :]

    numbers = range(len(parts))
    return Trajectory(
        np.concatenate([rows('stamps_ns', k) + shifts[k] for k in numbers]),
        np.concatenate([rows('positions_m', k) for k in numbers]),
        np.concatenate([rows('quaternions_xyzw', k) for k in numbers]),
        frame_id=frame_id,
        trigger_stamps_ns=np.concatenate(
            [parts[k].trigger_stamps_ns + shifts[k] for k in numbers]
        ),
        trigger_flow=np.concatenate([part.trigger_flow for part in parts]),
        trigger_brush=np.concatenate([part.trigger_brush for part in parts]),
    )


def _reversed(planned: PlannedPass) -> PlannedPass:
    length = float(planned.along_m[-1])
    return replace(
        planned,
        positions_m=planned.positions_m[::-1],
        rotations=planned.rotations[::-1],
        along_m=length - planned.along_m[::-1],
        on_m=length - planned.off_m,
        off_m=length - planned.on_m,
    )


def _travel_m(faces: Iterable[FacePasses]) -> float:
    return sum(
        float(np.linalg.norm(after.start_m - before.end_m)) for before, after in pairwise(faces)
    )


def _nearest_next(faces: Sequence[FacePasses]) -> tuple[FacePasses, ...]:
    """From the first on, each time the face that begins nearest."""
    order, left = [faces[0]], list(faces[1:])
    while left:
        end_m = order[-1].end_m
        nearest = min(left, key=lambda face: float(np.linalg.norm(face.start_m - end_m)))
        order.append(nearest)
        left = [face for face in left if face is not nearest]
    return tuple(order)
