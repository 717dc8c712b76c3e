"""What the part hides: lines of sight, the horizon around a point, and its share of the sky."""

import math
from collections.abc import Callable
from functools import cached_property
from threading import Lock

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from paint_deposition.kernel.blocks import shared_among_threads
from paint_deposition.kernel.compiler import named_for_its_code, njit
from paint_deposition.part.derivatives import tangents
from paint_deposition.part.face_tree import (
    DEPTH,
    FaceTree,
    box_distance,
    leaf_faces,
    support,
    wait,
)
from paint_deposition.part.points import box_centre_m

# Lower horizons count as this one [sine]: hardly any paint comes from there.
LEAST_SINE = 0.05
# What rounding may hide [sine], and how near a point a face passes through it [m].
SLACK_SINE, TOUCHING_M = 0.03, 1e-6
# Points with a part of the surface as high over them [sine] are not looked at any longer.
HIGH_SINE = 0.8


@njit(cache=True, nogil=True)
def _edge_sine(ax, ay, az, ah, bx, by, bz, bh):
    """Highest sine of elevation along an edge from a to b, seen from the origin.

    ``ah`` and ``bh`` are the heights of a and b over the plane at the origin.
    """
    best = -1.0
    a2 = ax * ax + ay * ay + az * az
    if a2 > TOUCHING_M * TOUCHING_M:
        best = ah / math.sqrt(a2)
    ex, ey, ez, eh = bx - ax, by - ay, bz - az, bh - ah
    e2 = ex * ex + ey * ey + ez * ez
    ae = ax * ex + ay * ey + az * ez
    below = eh * ae - ah * e2
    if below != 0.0:
        # Where height over distance is level along the edge.
        s = (ah * ae - eh * a2) / below
        if 0.0 < s < 1.0:
            w2 = a2 + s * (2.0 * ae + s * e2)
            if w2 > TOUCHING_M * TOUCHING_M:
                best = max(best, (ah + s * eh) / math.sqrt(w2))
    return best


@njit(cache=True, nogil=True)
def _face_sine(p, n, vertices, face):
    """Highest sine of elevation of a triangle over the plane at p with unit normal n."""
    i, j, k = face[0], face[1], face[2]
    ax, ay, az = vertices[i, 0] - p[0], vertices[i, 1] - p[1], vertices[i, 2] - p[2]
    bx, by, bz = vertices[j, 0] - p[0], vertices[j, 1] - p[1], vertices[j, 2] - p[2]
    cx, cy, cz = vertices[k, 0] - p[0], vertices[k, 1] - p[1], vertices[k, 2] - p[2]
    ah = ax * n[0] + ay * n[1] + az * n[2]
    bh = bx * n[0] + by * n[1] + bz * n[2]
    ch = cx * n[0] + cy * n[1] + cz * n[2]
    if max(ah, bh, ch) <= 0.0:
        return 0.0
    # Straight above p: the normal through p on one side of all three edges.
    u = n[0] * (ay * bz - az * by) + n[1] * (az * bx - ax * bz) + n[2] * (ax * by - ay * bx)
    v = n[0] * (by * cz - bz * cy) + n[1] * (bz * cx - bx * cz) + n[2] * (bx * cy - by * cx)
    w = n[0] * (cy * az - cz * ay) + n[1] * (cz * ax - cx * az) + n[2] * (cx * ay - cy * ax)
    area = u + v + w
    inside = area != 0.0 and (min(u, v, w) >= 0.0 or max(u, v, w) <= 0.0)
    if inside and (v * ah + w * bh + u * ch) / area > TOUCHING_M:
        return 1.0
    return max(
        _edge_sine(ax, ay, az, ah, bx, by, bz, bh),
        _edge_sine(bx, by, bz, bh, cx, cy, cz, ch),
        _edge_sine(cx, cy, cz, ch, ax, ay, az, ah),
    )


@njit(cache=True, nogil=True)
@named_for_its_code
def _bound(p, n, node):
    """No part of a node is seen from p under a higher sine of elevation, if that is below 1."""
    x, y, z = node[0] - p[0], node[1] - p[1], node[2] - p[2]
    height = n[0] * x + n[1] * y + n[2] * z + support(node, n[0], n[1], n[2])
    if height <= 0.0:
        return 0.0
    nearest = box_distance(p, node)
    return height / nearest if nearest > 0.0 else np.inf


@njit(cache=True, nogil=True)
@named_for_its_code
def _fill(points, normals, vertices, faces, nodes, start, stop, found):
    inner = len(nodes) // 2
    # Keys are bounds with the other sign: the highest is looked at first.
    waiting, keys = np.empty(DEPTH, dtype=np.int64), np.empty(DEPTH)
    highest_face = 0
    for i in range(start, stop):
        p = (points[i, 0], points[i, 1], points[i, 2])
        n = (normals[i, 0], normals[i, 1], normals[i, 2])
        # Neighbours mostly share the face that is highest.
        highest = max(LEAST_SINE - SLACK_SINE, _face_sine(p, n, vertices, faces[highest_face]))
        waiting[0], keys[0], left = 0, -np.inf, 1
        while left and highest < HIGH_SINE:
            left -= 1
            if not -keys[left] > highest + SLACK_SINE:
                continue
            node = waiting[left]
            if node < inner:
                first = -_bound(p, n, nodes[2 * node + 1])
                second = -_bound(p, n, nodes[2 * node + 2])
                left = wait(waiting, keys, left, node, first, second)
                continue
            for f in range(*leaf_faces(nodes, faces, node)):
                sine = _face_sine(p, n, vertices, faces[f])
                if sine > highest:
                    highest, highest_face = sine, f
        found[i] = highest + SLACK_SINE if highest < HIGH_SINE else 1.0


# The last bit of a ray before the point that it goes to, and how far above the surface a ray
# starts.
CLEARANCE_M = 5e-4
LIFT_M = 1e-4
AZIMUTHS, ELEVATIONS = 32, 8
SKY_RAYS = AZIMUTHS * ELEVATIONS
FAR_M = 1e3


class Occluder:
    """The part as an obstacle to rays; ``tree`` gives that of its faces with the first ray."""

    def __init__(self, tree: Callable[[], FaceTree]) -> None:
        self._tree = tree
        self._building = Lock()
        self._built: tuple[EmbreeScene, TriangleMesh] | None = None

    @cached_property
    def _origin_m(self) -> np.ndarray:
        """Embree works in single precision: coordinates are kept small."""
        return box_centre_m(self._tree().vertices_m)

    @property
    def _scene(self) -> EmbreeScene:
        """Made with the first ray, for all threads: it takes a second for a million triangles."""
        with self._building:
            if self._built is None:
                scene = EmbreeScene(robust=True)
                corners = (self._tree().vertices_m - self._origin_m).astype(np.float32)
                # The scene does not keep the mesh alive by itself.
                faces = self._tree().faces.astype(np.int32)
                self._built = scene, TriangleMesh(scene, corners, faces)
            return self._built[0]

    def sees(self, eyes_m: np.ndarray, points_m: np.ndarray) -> np.ndarray:
        """(...,) bool: whether nothing of the part lies between (..., 3) eyes and points on it.

        A point's own surroundings within CLEARANCE_M do not hide it, nor does surface that is seen
        from behind: incidence is the projection's business.
        """
        eyes, points = np.broadcast_arrays(eyes_m, points_m)
        way = points - eyes
        length = np.linalg.norm(way, axis=-1)
        direction = way / np.maximum(length, 1e-12)[..., None]
        blocked = self._blocked(
            eyes.reshape(-1, 3), direction.reshape(-1, 3), length.ravel() - CLEARANCE_M
        )
        return ~blocked.reshape(length.shape)

    def horizon_sines(self, points_m: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """(N,) sine of the highest elevation at which a point sees any of the part.

        Elevations are those over the plane at right angles to the point's normal (N, 3). A ray
        that comes to the point from higher up meets nothing on its way. No less than LEAST_SINE,
        and 1 where it is above HIGH_SINE.
        """
        tree, found = self._tree(), np.empty(len(points_m))
        points = np.ascontiguousarray(points_m, dtype=np.float64)
        upward = np.ascontiguousarray(normals, dtype=np.float64)

        def fill(start: int, stop: int) -> None:
            _fill(points, upward, tree.vertices_m, tree.faces, tree.nodes, start, stop, found)

        shared_among_threads(len(points), fill)
        return found

    def sky_view_factor(self, points_m: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """(N,) cosine-weighted share of the hemisphere over each point that the part leaves free.

        1 on flat and convex surface. The fixed set of SKY_RAYS directions resolves 0.002 where
        only the lowest sky is hidden, as in the shallow recesses of a door.
        """
        sky, weights = _sky()
        horizon = self.horizon_sines(points_m, normals)
        open_share = np.empty(len(points_m))
        rows = 1_000_000 // SKY_RAYS
        for start in range(0, len(points_m), rows):
            part = slice(start, start + rows)
            up = normals[part]
            frame = np.stack([*tangents(up), up])
            point, ray = np.nonzero(sky[2] <= horizon[part, None])
            direction = np.einsum('kr,kri->ri', sky[:, ray], frame[:, point])
            starts = points_m[part][point] + LIFT_M * up[point]
            blocked = self._blocked(starts, direction, np.full(len(starts), FAR_M))
            hidden = np.bincount(point, blocked * weights[ray], minlength=len(up))
            open_share[part] = 1.0 - hidden
        return open_share

    def _blocked(
        self, starts_m: np.ndarray, directions: np.ndarray, lengths_m: np.ndarray
    ) -> np.ndarray:
        hits = self._scene.run(
            (starts_m - self._origin_m).astype(np.float32),
            directions.astype(np.float32),
            dists=np.maximum(lengths_m, 0.0).astype(np.float32),
            query='OCCLUDED',
        )
        return hits >= 0


def _sky() -> tuple[np.ndarray, np.ndarray]:
    """(3, SKY_RAYS) directions about +z and their cosine weights (SKY_RAYS,), which sum to 1.

    The sky below elevation e has weight sin(e)^2; with t = sin(e) in equal strata rays lie close
    together near the horizon, where they are needed. Strata are shifted from azimuth to azimuth.
    """
    azimuth, stratum = np.divmod(np.arange(SKY_RAYS), ELEVATIONS)
    t = (stratum + 0.5 * (np.sqrt(5.0) - 1.0) * azimuth % 1.0) / ELEVATIONS
    angle = 2.0 * np.pi * (azimuth + 0.5) / AZIMUTHS
    across = np.sqrt(1.0 - t**2)
    return np.stack([across * np.cos(angle), across * np.sin(angle), t]), t / t.sum()
