"""Edges of a mesh that was read: creases, which split normals, rims and hems, and cut curves."""

import numpy as np

from paint_deposition.kernel.compiler import named_for_its_code, njit
from paint_deposition.kernel.fast_math import cross, difference, dot, length
from paint_deposition.part.edges import (
    BLOCK,
    connected,
    cut_segments,
    half_edges_m,
    near_pairs,
    next_half_edge,
)
from paint_deposition.part.refinement import edge_lengths_m, face_areas_m2

# Facets that meet at a larger angle are taken for a crease of the part, not for a coarse curve.
CREASE_RAD = np.radians(30.0)
# A convex fold at least this sharp ends the surface as a free edge does: a hem, the rim of a
# plate. Rims that are cut along one direction meet a crowned surface at less than a right angle.
RIM_FOLD_RAD = np.radians(60.0)
# A turn counts as that of a rim if it is made within this distance [m].
REACH_M = 0.01
# Edges with less of both, in radians and as a share of a gun's distance, cost next to nothing.
LEAST_ERROR = 5e-4


@njit(cache=True, nogil=True)
@named_for_its_code
def folds_rad(vertices, faces, normals, paired):
    """(E,) angle between the two triangles of each paired edge, positive if convex [rad]."""
    folds = np.empty(len(paired))
    for e in range(len(paired)):
        f, k = paired[e, 0] // 3, paired[e, 0] % 3
        one, other = normals[f], normals[paired[e, 1] // 3]
        axis = cross(one, other)
        angle = np.arctan2(length(axis), dot(one, other))
        along = difference(vertices[faces[f, (k + 1) % 3]], vertices[faces[f, k]])
        folds[e] = angle if dot(axis, along) >= 0.0 else -angle
    return folds


def rim_folds(
    vertices_m: np.ndarray, faces: np.ndarray, paired: np.ndarray, folds: np.ndarray
) -> np.ndarray:
    """(E,) bool: ``paired`` edges at which the surface ends by folding back, at once or in a hem.

    A hem is a row of folds that together turn convexly by as much as a rim.
    """
    rim = folds >= RIM_FOLD_RAD
    rows = np.flatnonzero(folds > np.radians(4.0))  # less is no fold
    ends_m = half_edges_m(vertices_m, faces, paired[rows, 0])
    beside = faces[paired[rows] // 3].reshape(-1, 3)
    area = face_areas_m2(vertices_m, beside).reshape(-1, 2).min(axis=1)
    width_m = 2.0 * area / np.linalg.norm(ends_m[:, 1] - ends_m[:, 0], axis=1)
    # Folds that turn more slowly belong to a curved surface.
    close = folds[rows] > 20.0 * width_m
    rows, ends_m = rows[close], ends_m[close]
    if not len(rows):
        return rim
    along = ends_m[:, 1] - ends_m[:, 0]
    lengths_m = np.maximum(np.linalg.norm(along, axis=1), 1e-12)
    along = along / lengths_m[:, None]
    pieces, whose = cut_segments(ends_m, 0.005)
    half = 0.5 * (lengths_m / np.bincount(whose))[whose]
    middle = pieces.mean(axis=1)
    fold = folds[rows]
    turn = fold[whose]
    for block, i, j, _ in near_pairs(middle, middle, REACH_M):
        i = i + block.start
        parallel = np.abs(np.einsum('ij,ij->i', along[whose[i]], along[whose[j]]))
        beside = (whose[i] != whose[j]) & (parallel > 0.8)
        i, j = i[beside], j[beside]
        ahead = np.abs(np.einsum('ij,ij->i', middle[j] - middle[i], along[whose[i]]))
        # Of a fold beside it in several pieces each counts as far as it lies abreast.
        abreast = 0.5 + (half[j] - ahead) / (2.0 * np.minimum(half[i], half[j]))
        turn += np.bincount(i, np.clip(abreast, 0.0, 1.0) * fold[whose[j]], minlength=len(turn))
    rim[rows[np.bincount(whose, turn >= RIM_FOLD_RAD, minlength=len(rows)) > 0]] = True
    return rim


def split_at_creases(faces: np.ndarray, smooth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Give each patch within which all paired edges are smooth, (S, 2), its own vertices.

    Returned are (W,) the vertex each new vertex is a copy of, and (F, 3) faces on the new
    vertices.
    """
    # The corners at both ends of smooth edges hang together.
    one, other = smooth.T
    starts = np.stack([one, next_half_edge(other)], axis=1)
    ends = np.stack([next_half_edge(one), other], axis=1)
    count, label = connected(np.concatenate([starts, ends]), faces.size)
    origin = np.empty(count, dtype=np.int64)
    origin[label] = faces.ravel()
    return origin, label.reshape(-1, 3)


def strip_vertices(
    corners_m: np.ndarray, patches: np.ndarray, hem_half_edges: np.ndarray, fine: np.ndarray,
    count: int,
) -> np.ndarray:  # fmt: skip
    """(count,) bool: vertices of patches (F, 3) so narrow that they belong to a hem.

    No two smooth patches share vertices; of each fold of a hem both half-edges are given. The
    vertices are those of the refined triangles ``fine``, the corners before all others.
    """
    if not len(hem_half_edges):
        return np.zeros(count, dtype=bool)
    _, patch = connected(fine, count)
    length_m = edge_lengths_m(corners_m, patches).ravel()[hem_half_edges]
    of_face = patch[patches[:, 0]]
    border = np.bincount(of_face[hem_half_edges // 3], length_m, minlength=patch.max() + 1)
    area = np.bincount(of_face, face_areas_m2(corners_m, patches), minlength=patch.max() + 1)
    # A strip has a fold on both its sides, and is no wider than this between them [m].
    return (2.0 * area < 0.02 * border)[patch]


# An edge of a mesh as it was read, see ``curved_edges``.
CURVED_EDGE = np.dtype([
    # Its middle [m] and outward unit normal as the refined mesh has them, and as the curve does.
    ('middle_m', float, 3), ('normal', float, 3),
    ('curved_m', float, 3), ('curved_normal', float, 3),
    ('length_m', float),
    ('turn_rad', float),  # by which the normals turn along it
])  # fmt: skip


def curved_edges(
    vertices_m: np.ndarray, normals: np.ndarray, faces: np.ndarray, half_edges: np.ndarray
) -> np.ndarray:
    """(E,) CURVED_EDGE, those at which a mesh is furthest from the curve it stands for.

    Between two corners the refined mesh is straight, and its normals turn evenly. A curve through
    the corners does neither. Its slope against the edge, averaged along the edge, is zero, since
    it leaves one corner and arrives at the other. The corners' normals say what the slope is at
    both ends; with a parabola for the slope in between, which has that average, the curve's middle
    is known:

        lean = (n_a + n_b) . e / 2           slope that an even turn has, to be taken away
        normal in the middle:  n - 1.5 lean e
        point in the middle:   + length turn / 8 along n,   turn = (n_b - n_a) . e

    with e along the edge (Vlachos et al., Curved PN triangles, 2001, for the same parabola). On a
    plane both are zero. Where the curvature begins or ends, the corners' normals are off
    themselves, and lean shows that, too.

    The triangles are those of a file, whose smooth patches have corners of their own; of each edge
    one of its half-edges is given, or both. Facets that meet at a crease, see CREASE_RAD, have
    corners and normals of their own there: a crease is no curve. So is a curve that is drawn with
    facets at such angles.
    """
    bent = []
    for some in np.array_split(half_edges, 1 + len(half_edges) // BLOCK):
        edges = faces.ravel()[np.stack([some, next_half_edge(some)], axis=1)]
        bent.append(edges[_bends(vertices_m, normals, edges)[0] > LEAST_ERROR])
    edges = np.unique(np.sort(np.concatenate(bent), axis=1), axis=0)
    worst_first = np.argsort(-_bends(vertices_m, normals, edges)[0], kind='stable')
    edges = edges[worst_first[:5000]]
    _, lengths, lean, sagitta = _bends(vertices_m, normals, edges)
    start, end = edges.T
    along = (vertices_m[end] - vertices_m[start]) / lengths[:, None]
    found = np.empty(len(edges), CURVED_EDGE)
    found['middle_m'] = 0.5 * (vertices_m[start] + vertices_m[end])
    found['normal'] = normal = _unit(normals[start] + normals[end])
    found['curved_m'] = found['middle_m'] + sagitta[:, None] * normal
    found['curved_normal'] = _unit(normal - 1.5 * lean[:, None] * along)
    found['length_m'] = lengths
    cosine = np.einsum('ij,ij->i', normals[start], normals[end])
    found['turn_rad'] = np.arccos(np.clip(cosine, -1.0, 1.0))
    return found


def _bends(
    vertices_m: np.ndarray, normals: np.ndarray, edges: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """What edges (E, 2) cost, their lengths, leans and sagittas."""
    start, end = edges.T
    along = vertices_m[end] - vertices_m[start]
    length = np.linalg.norm(along, axis=1)
    along /= np.maximum(length, 1e-12)[:, None]
    at_start, at_end = (np.einsum('ij,ij->i', normals[v], along) for v in (start, end))
    lean, sagitta = 0.5 * (at_start + at_end), length * (at_end - at_start) / 8.0
    cost = 1.5 * np.abs(lean) + 2.0 * np.abs(sagitta) / 0.3  # a gun's distance [m]
    # What a shorter edge costs lies within the spot of a gauge: fillets and hems.
    return np.where(length < 0.004, 0.0, cost), length, lean, sagitta


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12)
