"""What the part hides: lines of sight, the horizon around a point, and its share of the sky."""

import math
from functools import partial

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from paint_deposition.kernel.blocks import shared_among_threads
from paint_deposition.kernel.compiler import named_for_its_code, njit
from paint_deposition.kernel.fast_math import cross, difference, dot
from paint_deposition.part.derivatives import tangents
from paint_deposition.part.face_tree import (
    DEPTH,
    FaceTree,
    box_distance,
    leaf_faces,
    support,
    wait,
)

# Lower horizons count as this one [sine]: hardly any paint comes from there.
LEAST_SINE = 0.05
# What rounding may hide [sine], and how near a point a face passes through it [m].
SLACK_SINE, TOUCHING_M = 0.03, 1e-6
# Points with a part of the surface as high over them [sine] are not looked at any longer.
HIGH_SINE = 0.8


@njit(cache=True, nogil=True)
@named_for_its_code
def _edge_sine(a, ah, b, bh):
    """Highest sine of elevation along an edge from a to b, seen from the origin.

    ``ah`` and ``bh`` are the heights of a and b over the plane at the origin.
    """
    best, a2 = -1.0, dot(a, a)
    if a2 > TOUCHING_M * TOUCHING_M:
        best = ah / math.sqrt(a2)
    edge, eh = difference(b, a), bh - ah
    e2, ae = dot(edge, edge), dot(a, edge)
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
@named_for_its_code
def _face_sine(p, n, vertices, face):
    """Highest sine of elevation of a triangle over the plane at p with unit normal n."""
    a, b = difference(vertices[face[0]], p), difference(vertices[face[1]], p)
    c = difference(vertices[face[2]], p)
    ah, bh, ch = dot(a, n), dot(b, n), dot(c, n)
    if max(ah, bh, ch) <= 0.0:
        return 0.0
    # Straight above p: the normal through p on one side of all three edges.
    u, v, w = dot(n, cross(a, b)), dot(n, cross(b, c)), dot(n, cross(c, a))
    area = u + v + w
    inside = area != 0.0 and (min(u, v, w) >= 0.0 or max(u, v, w) <= 0.0)
    if inside and (v * ah + w * bh + u * ch) / area > TOUCHING_M:
        return 1.0
    return max(_edge_sine(a, ah, b, bh), _edge_sine(b, bh, c, ch), _edge_sine(c, ch, a, ah))


@njit(cache=True, nogil=True)
@named_for_its_code
def _bound(p, n, node):
    """No part of a node is seen from p under a higher sine of elevation, if that is below 1."""
    height = dot(n, difference(node, p)) + support(node, n)
    if height <= 0.0:
        return 0.0
    nearest = box_distance(p, node)
    return height / nearest if nearest > 0.0 else np.inf


@njit(cache=True, nogil=True)
@named_for_its_code
def _fill(points, normals, vertices, faces, nodes, found, start, stop):
    inner = len(nodes) // 2
    # Keys are bounds with the other sign: the highest is looked at first.
    waiting, keys = np.empty(DEPTH, dtype=np.int64), np.empty(DEPTH)
    highest_face = 0
    for i in range(start, stop):
        p, n = points[i], normals[i]
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
BEYOND_THE_PART_M = 1e3


# A scene, the point (3,) that its coordinates are relative to [m], and its mesh, which the scene
# does not keep alive by itself.
Obstacle = tuple[EmbreeScene, np.ndarray, TriangleMesh]


def sees(obstacle: Obstacle, eyes_m: np.ndarray, points_m: np.ndarray) -> np.ndarray:
    """(...,) bool: whether nothing of the part lies between (..., 3) eyes and points on it.

    A point's own surroundings within CLEARANCE_M do not hide it, nor does surface that is seen
    from behind: incidence is the projection's business.
    """
    eyes, points = np.broadcast_arrays(eyes_m, points_m)
    way = points - eyes
    length = np.linalg.norm(way, axis=-1)
    direction = way / np.maximum(length, 1e-12)[..., None]
    blocked = _blocked(
        obstacle, eyes.reshape(-1, 3), direction.reshape(-1, 3), length.ravel() - CLEARANCE_M
    )
    return ~blocked.reshape(length.shape)


def horizon_sines(tree: FaceTree, points_m: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(N,) sine of the highest elevation at which a point sees any of the part.

    Elevations are those over the plane at right angles to the point's normal (N, 3). A ray
    that comes to the point from higher up meets nothing on its way. No less than LEAST_SINE,
    and 1 where it is above HIGH_SINE.
    """
    found, points = np.empty(len(points_m)), np.ascontiguousarray(points_m, dtype=np.float64)
    upward = np.ascontiguousarray(normals, dtype=np.float64)

    fill = partial(_fill, points, upward, tree.vertices_m, tree.faces, tree.nodes, found)
    shared_among_threads(len(points), fill)
    return found


def sky_view_factor(
    tree: FaceTree, obstacle: Obstacle, points_m: np.ndarray, normals: np.ndarray
) -> np.ndarray:
    """(N,) cosine-weighted share of the hemisphere over each point that the part leaves free.

    1 on flat and convex surface. The fixed set of SKY_RAYS directions resolves 0.002 where
    only the lowest sky is hidden, as in the shallow recesses of a door.
    """
    # Directions (3, SKY_RAYS) about +z. The sky below elevation e has weight sin(e)^2; with
    # t = sin(e) in equal strata rays lie close together near the horizon, where they are
    # needed. Strata are shifted from azimuth to azimuth.
    azimuth, stratum = np.divmod(np.arange(SKY_RAYS), ELEVATIONS)
    t = (stratum + 0.5 * (np.sqrt(5.0) - 1.0) * azimuth % 1.0) / ELEVATIONS
    angle, across = 2.0 * np.pi * (azimuth + 0.5) / AZIMUTHS, np.sqrt(1.0 - t**2)
    sky, weights = np.stack([across * np.cos(angle), across * np.sin(angle), t]), t / t.sum()
    horizon = horizon_sines(tree, points_m, normals)
    open_share = np.empty(len(points_m))
    rows = 1_000_000 // SKY_RAYS
    for start in range(0, len(points_m), rows):
        part = slice(start, start + rows)
        up = normals[part]
        frame = np.stack([*tangents(up), up])
        point, ray = np.nonzero(sky[2] <= horizon[part, None])
        direction = np.einsum('kr,kri->ri', sky[:, ray], frame[:, point])
        starts = points_m[part][point] + LIFT_M * up[point]
        blocked = _blocked(obstacle, starts, direction, np.full(len(starts), BEYOND_THE_PART_M))
        hidden = np.bincount(point, blocked * weights[ray], minlength=len(up))
        open_share[part] = 1.0 - hidden
    return open_share


def _blocked(
    obstacle: Obstacle, starts_m: np.ndarray, directions: np.ndarray, lengths_m: np.ndarray
) -> np.ndarray:
    scene, origin_m, _ = obstacle
    hits = scene.run(
        (starts_m - origin_m).astype(np.float32),
        directions.astype(np.float32),
        dists=np.maximum(lengths_m, 0.0).astype(np.float32),
        query='OCCLUDED',
    )
    return hits >= 0
