"""Parcels fly from the emission point to the part; those that land under a gauge probe count."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from scipy.ndimage import distance_transform_edt

from .doors import OUTLINE_MARGIN_M, Part
from .parcels import Parcels

PROBE_RADIUS_M, BELL_RADIUS_M = 0.012, 0.025
GRID_M = 0.004
_NEWTON_STEPS = 8


def _compiled(function):
    """Kept under the name of its module: demo and tests import this folder by other names."""
    function.__qualname__ = f'{__name__}.{function.__name__}'
    return numba.njit(cache=True)(function)


@dataclass(frozen=True)
class Slices:
    """Time slices of the spraying gun; ends of slice k are rows k of the `_0` and `_1` arrays."""

    time_0_s: np.ndarray
    time_1_s: np.ndarray
    tcp_0_m: np.ndarray  # (n, 3)
    tcp_1_m: np.ndarray
    turn_0: np.ndarray  # (n, 3, 3), columns are the tool's axes
    turn_1: np.ndarray
    flow_0_cm3_per_s: np.ndarray
    flow_1_cm3_per_s: np.ndarray


@dataclass(frozen=True)
class Air:
    """What the air does to a parcel under way.

    drift_m: (n, 3) displacement of the mean droplet at the model plane, per slice, part frame.
    narrowing: (p,) 0 flies straight from the emission point, 1 parallel to the axis beyond it.
    growth: power of the way that displacement grows with: 1 at once, 2 where air begins to pull.
    """

    drift_m: np.ndarray
    narrowing: np.ndarray
    growth: float = 1.5


@dataclass(frozen=True)
class Landings:
    """Parcels that landed within a probe. All arrays (h,) unless said."""

    point: np.ndarray  # which gauge point
    film_um: np.ndarray  # its share of the film there, before anything is lost
    position_m: np.ndarray  # (h, 3)
    cos_incidence: np.ndarray
    beyond_m: np.ndarray  # path flown beyond the model plane (negative: before it)
    rim_m: np.ndarray  # (h, 3) where the parcel left the bell's edge


@_compiled
def _surface(x, z, x0, z0, step, fields):
    i = min(max((x - x0) / step, 0.0), fields.shape[1] - 1.001)
    j = min(max((z - z0) / step, 0.0), fields.shape[0] - 1.001)
    a, b = int(i), int(j)
    u, v = i - a, j - b
    w00, w10, w01, w11 = (1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v
    p, q, r, s = fields[b, a], fields[b, a + 1], fields[b + 1, a], fields[b + 1, a + 1]
    return (
        w00 * p[0] + w10 * q[0] + w01 * r[0] + w11 * s[0],
        w00 * p[1] + w10 * q[1] + w01 * r[1] + w11 * s[1],
        w00 * p[2] + w10 * q[2] + w01 * r[2] + w11 * s[2],
    )


@_compiled
def _fly(
    tcp0, tcp1, turn0, turn1, drift, count, px, py, mobility, narrowing, growth, plane, offset,
    bell_radius, x0, z0, step, fields, points, cx0, cz0, cell, starts, members, cells_x, cells_z,
    far, radius, capacity,
):  # fmt: skip
    hit_point = np.empty(capacity, np.int32)
    hit_slice = np.empty(capacity, np.int32)
    hit_moment = np.empty(capacity)
    hits = np.empty((capacity, 9))
    found, parcel, pool = 0, 0, px.size
    start_share = offset / plane
    o = np.empty(3)
    c = np.empty((3, 3))
    for k in range(tcp0.shape[0]):
        for emitted in range(count[k]):
            m = (emitted + 0.5) / count[k]
            qx, qy = px[parcel], py[parcel]
            wide, carried = 1.0 - narrowing[parcel], mobility[parcel]
            parcel = parcel + 1 if parcel + 1 < pool else 0
            for a in range(3):
                for b in range(3):
                    c[a, b] = turn0[k, a, b] + m * (turn1[k, a, b] - turn0[k, a, b])
                o[a] = tcp0[k, a] + m * (tcp1[k, a] - tcp0[k, a]) - offset * c[a, 2]
            bx, by, bz = carried * drift[k, 0], carried * drift[k, 1], carried * drift[k, 2]
            # slope of the flight per metre along the tool's axis, and its intercept there
            fx = (c[0, 0] * qx + c[0, 1] * qy) * wide / plane + c[0, 2]
            fy = (c[1, 0] * qx + c[1, 1] * qy) * wide / plane + c[1, 2]
            fz = (c[2, 0] * qx + c[2, 1] * qy) * wide / plane + c[2, 2]
            if fy > -0.05:
                continue
            gx = o[0] + (c[0, 0] * qx + c[0, 1] * qy) * (1.0 - wide)
            gy = o[1] + (c[1, 0] * qx + c[1, 1] * qy) * (1.0 - wide)
            gz = o[2] + (c[2, 0] * qx + c[2, 1] * qy) * (1.0 - wide)
            make_surface, slope_x, slope_z = _surface(o[0], o[2], x0, z0, step, fields)
            axial, landed = (make_surface - gy) / fy, False
            x = y = z = slope_x = slope_z = 0.0
            ex, ey, ez = fx, fy, fz
            for _step in range(_NEWTON_STEPS):
                share = (axial / plane - start_share) / (1.0 - start_share)
                if share > 0.0:
                    bent = share**growth
                    bending = growth * bent / (share * (1.0 - start_share) * plane)
                else:
                    bent, bending = 0.0, 0.0
                x, y = gx + axial * fx + bx * bent, gy + axial * fy + by * bent
                z = gz + axial * fz + bz * bent
                ex, ey, ez = fx + bx * bending, fy + by * bending, fz + bz * bending
                make_surface, slope_x, slope_z = _surface(x, z, x0, z0, step, fields)
                miss = y - make_surface
                if abs(miss) < 2e-6:
                    landed = True
                    break
                closing = ey - slope_x * ex - slope_z * ez
                if closing > -0.02:
                    break
                axial -= miss / closing
                # no probe can be reached from here any more: most parcels end at this line
                i = min(max(int((x - cx0) / cell), 0), cells_x - 1)
                j = min(max(int((z - cz0) / cell), 0), cells_z - 1)
                if far[j, i] > 2.0 * abs(miss / closing) * (abs(ex) + abs(ez)):
                    break
            if not landed or axial < offset:
                continue
            i, j = int(np.floor((x - cx0) / cell)), int(np.floor((z - cz0) / cell))
            if i < 0 or j < 0 or i >= cells_x or j >= cells_z:
                continue
            box = j * cells_x + i
            for n in range(starts[box], starts[box + 1]):
                g = members[n]
                d2 = (
                    (x - points[g, 0]) ** 2 + (y - points[g, 1]) ** 2 + (z - points[g, 2]) ** 2
                ) / radius**2
                if d2 >= 1.0:
                    continue
                speed = np.sqrt(ex * ex + ey * ey + ez * ez)
                facing = -(-slope_x * ex + ey - slope_z * ez) / (
                    speed * np.sqrt(1.0 + slope_x**2 + slope_z**2)
                )
                if facing <= 0.0:
                    continue
                if found == capacity:
                    return -1, hit_point, hit_slice, hit_moment, hits
                hit_point[found], hit_slice[found], hit_moment[found] = g, k, m
                h = hits[found]
                h[0] = 2.0 / (np.pi * radius**2) * (1.0 - d2)
                h[1], h[2], h[3] = x, y, z
                h[4] = facing
                h[5] = (axial - plane) * np.sqrt(fx * fx + fy * fy + fz * fz)
                q = np.sqrt(qx * qx + qy * qy) + 1e-12
                for a in range(3):
                    h[6 + a] = (
                        o[a] + offset * c[a, 2] + bell_radius * (c[a, 0] * qx + c[a, 1] * qy) / q
                    )
                found += 1
    return found, hit_point, hit_slice, hit_moment, hits


def fly(
    part: Part, slices: Slices, parcels: Parcels, air: Air, points_m: np.ndarray,
    model_plane_m: float, emission_offset_m: float, parcels_total: int,
) -> Landings:  # fmt: skip
    """Trace about so many parcels, in proportion to durations, and keep those within a probe.

    A landing's film is its solids (cm^3 = um m^2) spread by an Epanechnikov kernel (1/m^2).
    """
    duration = slices.time_1_s - slices.time_0_s
    count = np.maximum(np.rint(duration * parcels_total / duration.sum() / 64), 4).astype(int) * 64
    x0, z0, fields = _surface_grid(part)
    cells = _probe_cells(points_m)
    capacity = max(int(0.02 * parcels_total), 1000)
    while True:
        found, point, k, moment, hits = _fly(
            slices.tcp_0_m, slices.tcp_1_m, slices.turn_0, slices.turn_1, air.drift_m, count,
            parcels.x_m, parcels.y_m, parcels.mobility, air.narrowing, air.growth, model_plane_m,
            emission_offset_m, BELL_RADIUS_M, x0, z0, GRID_M, fields, points_m, *cells,
            PROBE_RADIUS_M, capacity,
        )  # fmt: skip
        if found >= 0:
            break
        capacity *= 3
    point, k, moment, hits = point[:found], k[:found], moment[:found], hits[:found]
    flow = slices.flow_0_cm3_per_s[k] * (1 - moment) + slices.flow_1_cm3_per_s[k] * moment
    film = hits[:, 0] * flow * (duration / count)[k]
    return Landings(point, film, hits[:, 1:4], hits[:, 4], hits[:, 5], hits[:, 6:9])


def _surface_grid(part: Part) -> tuple[float, float, np.ndarray]:
    x0, z0 = -0.5 * part.width_m - OUTLINE_MARGIN_M, -OUTLINE_MARGIN_M
    x = np.arange(x0, 0.5 * part.width_m + OUTLINE_MARGIN_M + GRID_M, GRID_M)[None, :]
    z = np.arange(z0, part.height_m + OUTLINE_MARGIN_M + GRID_M, GRID_M)[:, None]
    y_x, y_z = part.slope(x + 0 * z, z + 0 * x)
    return x0, z0, np.stack([part.height(x, z), y_x, y_z], axis=-1)


def _probe_cells(points_m: np.ndarray) -> tuple:
    """Squares of one probe radius, each with the probes that can reach into it (CSR lists)."""
    cell = PROBE_RADIUS_M
    low = points_m[:, [0, 2]].min(axis=0) - 2 * cell
    where = ((points_m[:, [0, 2]] - low) / cell).astype(int)
    size = where.max(axis=0) + 3
    boxes = [[] for _ in range(size[0] * size[1])]
    for g, (i, j) in enumerate(where):
        for a in (-1, 0, 1):
            for b in (-1, 0, 1):
                boxes[(j + b) * size[0] + i + a].append(g)
    starts = np.concatenate([[0], np.cumsum([len(b) for b in boxes])]).astype(np.int64)
    members = np.array([g for b in boxes for g in b], dtype=np.int64)
    empty = np.array([not b for b in boxes]).reshape(size[1], size[0])
    far = np.maximum(distance_transform_edt(empty) - 1.5, -1.0) * cell
    return float(low[0]), float(low[1]), cell, starts, members, int(size[0]), int(size[1]), far
