"""Where points near the part lie on its surface."""

from dataclasses import dataclass

import numpy as np

from paint_deposition.kernel.compiler import named_for_its_code, njit
from paint_deposition.part.face_tree import DEPTH, FaceTree, box_distance, leaf_faces, wait

# How much further away than the nearest surface the side that a normal points out of may be.
THICKNESS_M = 0.06
# Surface that leans further than this from the side that is painted is its back.
BACK_COSINE = -0.5


@dataclass(frozen=True)
class Location:
    """Places on the surface closest to N points."""

    positions_m: np.ndarray  # (N, 3) the places [m]
    normals: np.ndarray  # (N, 3) outward unit normals of the surface there
    distance_m: np.ndarray  # (N,) from the point to the place [m]
    # (N,) between the point's own normal and the surface's, NaN where none was given.
    angle_rad: np.ndarray


def locate(
    tree: FaceTree,
    vertex_normals: np.ndarray,
    points_m: np.ndarray,
    normals: np.ndarray | None = None,
    side: np.ndarray | None = None,
    least_cosine: float = 0.0,
) -> Location:
    """See ``Surface.locate``; without ``normals`` the back of the only ``side`` is not taken.

    Surface agrees with ``normals`` if the cosine between them is no less than ``least_cosine``.
    """
    points: np.ndarray = np.ascontiguousarray(points_m, dtype=np.float64).reshape(-1, 3)
    if not np.isfinite(points).all():
        raise ValueError('points to be located are not finite')
    wanted: np.ndarray
    if normals is not None:
        wanted = np.ascontiguousarray(normals, dtype=np.float64).reshape(-1, 3)
        least = least_cosine
    elif side is not None:
        wanted, least = np.broadcast_to(side, points.shape).astype(np.float64), BACK_COSINE
    else:
        wanted, least = np.zeros_like(points), -1.0
    face, place = np.empty(len(points), dtype=np.int64), np.empty(points.shape)
    _find(
        points, wanted, least, tree.vertices_m, vertex_normals, tree.faces, tree.nodes, face, place
    )
    corners = tree.faces[face]
    weights = _barycentric(tree.vertices_m[corners], place)
    outward = np.einsum('nk,nki->ni', weights, vertex_normals[corners])
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    angle = np.full(len(points), np.nan)
    if normals is not None:
        across = np.linalg.norm(np.cross(outward, wanted), axis=1)
        angle = np.arctan2(across, np.einsum('ij,ij->i', outward, wanted))
    return Location(place, outward, np.linalg.norm(points - place, axis=1), angle)


@njit(cache=True, nogil=True)
def closest_place(a, b, c, p):
    """The place on a triangle that is closest to a point; all are (x, y, z).

    Ericson, Real-Time Collision Detection (2005), section 5.1.5.
    """
    abx, aby, abz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    acx, acy, acz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    apx, apy, apz = p[0] - a[0], p[1] - a[1], p[2] - a[2]
    d1 = abx * apx + aby * apy + abz * apz
    d2 = acx * apx + acy * apy + acz * apz
    abab = abx * abx + aby * aby + abz * abz
    abac = abx * acx + aby * acy + abz * acz
    acac = acx * acx + acy * acy + acz * acz
    # The same from b and from c, and the areas of the triangles that the point makes.
    d3, d4, d5, d6 = d1 - abab, d2 - abac, d1 - abac, d2 - acac
    of_a, of_b, of_c = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0.0 and d2 <= 0.0:
        v, w = 0.0, 0.0
    elif d3 >= 0.0 and d4 <= d3:
        v, w = 1.0, 0.0
    elif of_c <= 0.0 <= d1 and d3 <= 0.0:
        v, w = d1 / (d1 - d3), 0.0
    elif d6 >= 0.0 and d5 <= d6:
        v, w = 0.0, 1.0
    elif of_b <= 0.0 <= d2 and d6 <= 0.0:
        v, w = 0.0, d2 / (d2 - d6)
    elif of_a <= 0.0 and d4 >= d3 and d5 >= d6:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        v = 1.0 - w
    else:
        area = of_a + of_b + of_c
        v, w = of_b / area, of_c / area
    return a[0] + v * abx + w * acx, a[1] + v * aby + w * acy, a[2] + v * abz + w * acz


@njit(cache=True, nogil=True)
def _corner(values, v):
    return values[v, 0], values[v, 1], values[v, 2]


@njit(cache=True, nogil=True)
def _agreement(normals, face, wanted):
    """Mean of the normals of a triangle's corners along a vector."""
    total = 0.0
    for k in range(3):
        total += wanted[k] * (normals[face[0], k] + normals[face[1], k] + normals[face[2], k])
    return total / 3.0


@njit(cache=True, nogil=True)
@named_for_its_code
def _find(points, wanted, least, vertices, normals, faces, nodes, found, places):
    """Set the row in ``faces`` and the place (N, 3) closest to each point.

    Surface that agrees less than ``least`` with what is wanted counts as THICKNESS_M further away.
    """
    inner = len(nodes) // 2
    waiting, away = np.empty(DEPTH, dtype=np.int64), np.empty(DEPTH)
    for i in range(len(points)):
        p, nearest = _corner(points, i), np.inf
        waiting[0], away[0], left = 0, 0.0, 1
        while left:
            left -= 1
            if not away[left] < nearest:
                continue
            node = waiting[left]
            if node < inner:
                first = box_distance(p, nodes[2 * node + 1])
                second = box_distance(p, nodes[2 * node + 2])
                left = wait(waiting, away, left, node, first, second)
                continue
            for f in range(*leaf_faces(nodes, faces, node)):
                a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
                x, y, z = closest_place(
                    _corner(vertices, a), _corner(vertices, b), _corner(vertices, c), p
                )
                distance = np.sqrt((x - p[0]) ** 2 + (y - p[1]) ** 2 + (z - p[2]) ** 2)
                if distance < nearest and _agreement(normals, faces[f], wanted[i]) < least:
                    distance += THICKNESS_M
                if distance < nearest:
                    nearest, found[i] = distance, f
                    places[i, 0], places[i, 1], places[i, 2] = x, y, z


def _barycentric(corners_m: np.ndarray, points_m: np.ndarray) -> np.ndarray:
    """(N, 3) weights of the corners (N, 3, 3) at points (N, 3) in their triangles."""
    a, b, c = corners_m.transpose(1, 0, 2)
    whole = np.cross(b - a, c - a)
    size2 = np.einsum('ij,ij->i', whole, whole)
    of_b = np.einsum('ij,ij->i', np.cross(points_m - a, c - a), whole) / size2
    of_c = np.einsum('ij,ij->i', np.cross(b - a, points_m - a), whole) / size2
    weights = np.clip(np.stack([1.0 - of_b - of_c, of_b, of_c], axis=1), 0.0, 1.0)
    return weights / weights.sum(axis=1, keepdims=True)
