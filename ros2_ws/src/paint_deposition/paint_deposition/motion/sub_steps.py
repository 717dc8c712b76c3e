"""Segments between poses cut into sub-steps: position linear, orientation slerped.

Robots log up to a thousand poses a second, finer than sub-steps need to be: poses between are
passed over. What a film costs follows the length of the path, not the rate of its log.

Compiled one row at a time and without fast-math, so that a row's numbers do not depend on which
other rows came in the same call: a live stream and an offline run give the same bits.
"""

import math

import numpy as np

from paint_deposition.kernel.compiler import njit

# A turn of the tool moves the far end of the spray; this lever turns it into a travel [m].
LEVER_M = 0.3
# A segment is not cut finer, however far a pose is off: that is 80 m in one go.
MOST_SUB_STEPS = 10_000
# Poses are passed over until the spray has travelled this share of the longest sub-step...
LEAST_SHARE = 0.5
# ... or this long [ns], so that the film grows under a gun that stands still.
LEAST_NS = 50_000_000
# A pose by which the way is longer than past it, by more than this share of such a travel, is a
# corner and followed.
CORNER_SHARE = 0.1


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
def _distance(p0, p1):
    return math.sqrt((p1[0] - p0[0]) ** 2 + (p1[1] - p0[1]) ** 2 + (p1[2] - p0[2]) ** 2)


@njit(cache=True)
def spray_travel_m(p0, p1, q0, q1):
    """How far the spray travels between two poses, a turn of the tool included [m]."""
    dot = abs(q0[0] * q1[0] + q0[1] * q1[1] + q0[2] * q1[2] + q0[3] * q1[3])
    return _distance(p0, p1) + LEVER_M * (2.0 * math.acos(min(dot, 1.0)))


@njit(cache=True)
def count_sub_steps(p0, p1, q0, q1, max_step_m):
    """How many sub-steps keep the spray's travel in each below the limit."""
    travel = spray_travel_m(p0, p1, q0, q1)
    return int(math.ceil(min(max(travel / max_step_m, 1.0), MOST_SUB_STEPS)))


@njit(cache=True)
def _detour_m(p0, p1, p2):
    """By how much the way from p0 to p2 is longer by p1 [m]."""
    return _distance(p0, p1) + _distance(p1, p2) - _distance(p0, p2)


@njit(cache=True)
def followed_poses(stamps_ns, positions, quaternions, max_gap_ns, max_step_m):
    """Rows (K,) of the poses that are followed, the first among them; those behind the last wait.

    Each pose is decided on by the last one followed, the one before it and itself: it does not
    matter how a stream was cut into calls, if each begins at the last pose followed. Stamps (N,)
    int64 increase strictly, positions (N, 3) [m], quaternions (N, 4) unit. The poses at the ends
    of a time longer than ``max_gap_ns`` are followed.
    """
    rows = np.zeros(len(stamps_ns), np.int64)
    count, last = 1, 0
    longest_ns, least_m = min(LEAST_NS, max_gap_ns), LEAST_SHARE * max_step_m
    for i in range(1, len(stamps_ns)):
        if last < i - 1:
            detour_m = _detour_m(positions[last], positions[i - 1], positions[i])
            if detour_m > CORNER_SHARE * least_m or stamps_ns[i] - stamps_ns[last] > max_gap_ns:
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
            whole[i] = count_sub_steps(
                positions[i], positions[i + 1], quaternions[i], quaternions[i + 1], max_step_m
            )
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
