"""The spray path: a motion cut into the sub-steps over which the film is integrated.

Between poses the position is linear and the orientation slerped. Robots log up to a thousand poses
a second, finer than sub-steps need to be: poses between are passed over. What a film costs follows
the length of the path, not the rate of its log.

Compiled one row at a time and without fast-math, so that a row's numbers do not depend on which
other rows came in the same call: a live stream and an offline run give the same bits.
"""

import math
from dataclasses import dataclass, fields, replace

import numpy as np

from paint_deposition.kernel.compiler import named_for_its_code, njit
from paint_deposition.kernel.fast_math import difference, length

# A turn of the tool moves the far end of the spray; this lever turns it into a travel [m].
LEVER_M = 0.3
# A segment is not cut finer, however far a pose is off: that is 80 m in one go.
MOST_SUB_STEPS = 10_000
# Poses are passed over until the spray has travelled this share of the longest sub-step.
LEAST_SHARE = 0.5


@njit(cache=True)
def slerp(q0, q1, t):
    """Spherical interpolation of unit quaternions (4,), the short way round; four numbers."""
    dot = q0[0] * q1[0] + q0[1] * q1[1] + q0[2] * q1[2] + q0[3] * q1[3]
    sign = -1.0 if dot < 0.0 else 1.0
    angle = math.acos(min(abs(dot), 1.0))
    if angle < 1e-6:
        w0, w1 = 1.0 - t, sign * t
    else:
        w0 = math.sin((1.0 - t) * angle) / math.sin(angle)
        w1 = sign * math.sin(t * angle) / math.sin(angle)
    x, y = w0 * q0[0] + w1 * q1[0], w0 * q0[1] + w1 * q1[1]
    z, w = w0 * q0[2] + w1 * q1[2], w0 * q0[3] + w1 * q1[3]
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    return x / norm, y / norm, z / norm, w / norm


@njit(cache=True)
def write_rotation(out, quaternion):
    """Write the rotation matrix of a unit quaternion, scalar last, into ``out`` (3, 3)."""
    x, y, z, w = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    # Number by number: assigned as a row each, these nine take seconds to compile.
    out[0, 0], out[0, 1] = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w)
    out[0, 2], out[1, 0] = 2.0 * (x * z + y * w), 2.0 * (x * y + z * w)
    out[1, 1], out[1, 2] = 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)
    out[2, 0], out[2, 1] = 2.0 * (x * z - y * w), 2.0 * (y * z + x * w)
    out[2, 2] = 1.0 - 2.0 * (x * x + y * y)


@njit(cache=True)
@named_for_its_code
def spray_travel_m(p0, p1, q0, q1):
    """How far the spray travels between two poses, a turn of the tool included [m]."""
    dot = abs(q0[0] * q1[0] + q0[1] * q1[1] + q0[2] * q1[2] + q0[3] * q1[3])
    return length(difference(p1, p0)) + LEVER_M * (2.0 * math.acos(min(dot, 1.0)))


@njit(cache=True)
@named_for_its_code
def thin_poses(stamps_ns, positions, quaternions, max_gap_ns, max_step_m):
    """Rows (K,) of the poses that are followed, the first among them; those behind the last wait.

    Each pose is decided on by the last one followed, the one before it and itself: it does not
    matter how a stream was cut into calls, if each begins at the last pose followed. Stamps (N,)
    int64 increase strictly, positions (N, 3) [m], quaternions (N, 4) unit. The poses at the ends
    of a time longer than ``max_gap_ns`` are followed.
    """
    rows = np.zeros(len(stamps_ns), np.int64)
    count, last = 1, 0
    # 50 ms at the most, so that the film grows under a gun that stands still.
    longest_ns, least_m = min(50_000_000, max_gap_ns), LEAST_SHARE * max_step_m
    for i in range(1, len(stamps_ns)):
        if last < i - 1:
            to_it = length(difference(positions[i - 1], positions[last]))
            by_it = to_it + length(difference(positions[i], positions[i - 1]))
            detour_m = by_it - length(difference(positions[i], positions[last]))
            # A pose by which the way is longer than past it, by a tenth of such a travel, is a
            # corner and followed.
            if detour_m > 0.1 * least_m or stamps_ns[i] - stamps_ns[last] > max_gap_ns:
                last = i - 1
                rows[count] = last
                count += 1
        travel = spray_travel_m(positions[last], positions[i], quaternions[last], quaternions[i])
        if travel >= least_m or stamps_ns[i] - stamps_ns[last] >= longest_ns:
            last = i
            rows[count] = last
            count += 1
    return rows[:count]


@njit(cache=True)
@named_for_its_code
def split_segments(stamps_ns, positions, quaternions, cuts_ns, max_gap_ns, max_step_m):
    """Cut every segment at the trigger's changes and then into sub-steps of ``max_step_m`` at
    most.

    Stamps (N,) and changes ``cuts_ns`` (C,) increase strictly, int64; positions (N, 3) [m],
    quaternions (N, 4) unit. A segment longer than ``max_gap_ns`` is gun off and gives no
    sub-steps.

    Returns:
        stamp_ns (M,), dwell_s (M,), position (M, 3), rotation (M, 3, 3), velocity (M, 3), and
        after_gap (M,) true on the first sub-step after a gap.
    """
    segments = len(stamps_ns) - 1
    # Every piece between cuts has a part of the segment's sub-steps, rounded up.
    most = segments + len(cuts_ns)
    whole = np.zeros(segments, np.int64)
    for i in range(segments):
        if stamps_ns[i + 1] - stamps_ns[i] <= max_gap_ns:
            travel = spray_travel_m(
                positions[i], positions[i + 1], quaternions[i], quaternions[i + 1]
            )
            whole[i] = int(math.ceil(min(max(travel / max_step_m, 1.0), MOST_SUB_STEPS)))
            most += whole[i]
    stamp, dwell, after_gap = np.empty(most, np.int64), np.empty(most), np.zeros(most, np.bool_)
    position, rotation, velocity = np.empty((most, 3)), np.empty((most, 3, 3)), np.empty((most, 3))
    row, cut, fresh = 0, 0, False
    for i in range(segments):
        if whole[i] == 0:
            fresh = True
            continue
        t0, t1 = stamps_ns[i], stamps_ns[i + 1]
        duration = np.float64(t1 - t0)
        while cut < len(cuts_ns) and cuts_ns[cut] <= t0:
            cut += 1
        begin = t0
        while begin < t1:
            end = t1
            if cut < len(cuts_ns) and cuts_ns[cut] < t1:
                end = cuts_ns[cut]
                cut += 1
            steps = max(1, int(math.ceil(whole[i] * (np.float64(end - begin) / duration))))
            after_gap[row] = fresh
            fresh = False
            for k in range(steps):
                middle = (np.float64(begin - t0) + (k + 0.5) / steps * (end - begin)) / duration
                stamp[row] = t0 + np.int64(round(middle * duration))
                dwell[row] = np.float64(end - begin) * 1e-9 / steps
                for axis in range(3):
                    step = positions[i + 1, axis] - positions[i, axis]
                    position[row, axis] = positions[i, axis] + middle * step
                    velocity[row, axis] = step * 1e9 / duration
                write_rotation(rotation[row], slerp(quaternions[i], quaternions[i + 1], middle))
                row += 1
            begin = end
    return (
        stamp[:row], dwell[:row], position[:row], rotation[:row], velocity[:row], after_gap[:row]
    )  # fmt: skip


@dataclass(frozen=True)
class SprayPath:
    """Sub-steps of the motion in time order, one row each; the nodes of the film integral."""

    stamp_ns: np.ndarray  # (M,) int64 middle of the sub-step
    time_s: np.ndarray  # (M,) the same since the motion began [s], NaN where that is not known
    dwell_s: np.ndarray  # (M,) its duration, the quadrature weight [s]
    flow: np.ndarray  # (M,) flow relative to the calibrated one; 0 is gun off
    position_m: np.ndarray  # (M, 3) TCP [m]
    rotation: np.ndarray  # (M, 3, 3) tool axes x, y, z as columns
    velocity_m_per_s: np.ndarray  # (M, 3) of the TCP [m/s]
    pattern_shift_m: np.ndarray  # (M, 2) of the pattern on the model plane, tool x and y [m]
    # (M,) int, number of the straight stroke; a new one starts where a turn of the path shows, up
    # to 40 mm behind it.
    stroke: np.ndarray
    spray_pass: np.ndarray  # (M,) int, number of the spraying pass, -1 before the first
    passes_before: np.ndarray  # (M,) int, spraying passes of the same gun before that one
    open_flow: np.ndarray  # (M,) flow of the opening that runs or ran last; 1 before the first
    # (M,) time since the trigger last opened and closed, inf if never [s].
    since_on_s: np.ndarray
    since_off_s: np.ndarray
    # (M,) time until it next does within the stroke, inf if not [s].
    until_on_s: np.ndarray
    until_off_s: np.ndarray
    # (M,) distance along the path from the last turn and to the next [m].
    from_turn_m: np.ndarray
    to_turn_m: np.ndarray
    # (M,) int, number of the brush of the opening that runs or ran last; 0 is the only one, and
    # before the first.
    brush: np.ndarray

    @staticmethod
    def of(
        stamp_ns: np.ndarray, dwell_s: np.ndarray, flow: np.ndarray, position_m: np.ndarray,
        rotation: np.ndarray, velocity_m_per_s: np.ndarray,
    ) -> 'SprayPath':  # fmt: skip
        """The motion alone, as one endless pass without turns and trigger changes."""
        count = len(flow)
        numbers, never = np.zeros(count, np.int64), np.full(count, np.inf)
        return SprayPath(
            stamp_ns, np.full(count, np.nan), dwell_s, flow, position_m, rotation,
            velocity_m_per_s, np.zeros((count, 2)), numbers, numbers, numbers,
            np.ones(count), never, never, never, never, never, never, numbers,
        )  # fmt: skip

    def __len__(self) -> int:
        return len(self.stamp_ns)

    @property
    def speed_m_per_s(self) -> np.ndarray:
        """(M,) speed of the TCP [m/s]."""
        return np.linalg.norm(self.velocity_m_per_s, axis=1)

    @property
    def spraying_time_s(self) -> float:
        """Time sprayed, weighted by the relative flow [s]: K1 times this was emitted."""
        return float(np.sum(self.dwell_s * self.flow))

    def with_flow_scaled(self, factor: float | np.ndarray) -> 'SprayPath':
        """The motion at another flow, times a factor or (M,) factors.

        The flow of the opening is scaled too: what still flows after a closing tails off from it.
        """
        return self.with_(flow=factor * self.flow, open_flow=factor * self.open_flow)

    def select(self, rows: slice | np.ndarray) -> 'SprayPath':
        """The chosen rows, by mask, slice or indices."""
        return SprayPath(*(getattr(self, item.name)[rows] for item in fields(self)))

    def with_(self, **columns: np.ndarray) -> 'SprayPath':
        """A copy with some columns replaced."""
        return replace(self, **columns)

    @staticmethod
    def empty() -> 'SprayPath':
        """No sub-steps."""
        none, whole = np.empty(0), np.empty(0, np.int64)
        vectors, axes = np.empty((0, 3)), np.empty((0, 3, 3))
        return SprayPath.of(whole, none, none, vectors, axes, vectors)

    @staticmethod
    def joined(paths: list['SprayPath']) -> 'SprayPath':
        """Paths one after the other."""
        return SprayPath(
            *(np.concatenate([getattr(p, item.name) for p in paths]) for item in fields(SprayPath))
        )

    @staticmethod
    def of_guns(paths: list['SprayPath']) -> 'SprayPath':
        """Paths of several guns on one part, gun after gun; strokes and passes numbered through.

        A gun alone keeps its path as it is.
        """
        numbered = []
        strokes = passes = 0
        for path in paths:
            number = np.where(path.spray_pass < 0, -1, path.spray_pass + passes)
            numbered.append(path.with_(stroke=path.stroke + strokes, spray_pass=number))
            strokes = int(numbered[-1].stroke.max(initial=strokes - 1)) + 1
            passes = int(number.max(initial=passes - 1)) + 1
        return SprayPath.joined(numbered)
