"""From the triangles of a file to a conforming mesh of bounded edge length."""

from functools import lru_cache

import numpy as np

from paint_deposition.errors import MeshError
from paint_deposition.kernel.compiler import named_for_its_code, njit
from paint_deposition.kernel.fast_math import cross, difference, length
from paint_deposition.part.edges import edges_of

MAX_TRIANGLES = 5_000_000
KEY_BASE = np.int64(1) << 31


def face_areas_m2(vertices_m: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(F,) areas [m^2]."""
    return _areas_and_normals(vertices_m, faces)[0]


def face_normals(vertices_m: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(F, 3) unit normals by the right-hand rule."""
    return _areas_and_normals(vertices_m, faces)[1]


@njit(cache=True, nogil=True)
@named_for_its_code
def edge_lengths_m(vertices_m, faces):
    """(F, 3) lengths of the edges from each corner to the next [m]."""
    lengths = np.empty(faces.shape)
    for f in range(len(faces)):
        for k in range(3):
            a, b = vertices_m[faces[f, k]], vertices_m[faces[f, (k + 1) % 3]]
            lengths[f, k] = length(difference(b, a))
    return lengths


@njit(cache=True, nogil=True, error_model='numpy')
@named_for_its_code
def _areas_and_normals(vertices, faces):
    areas, normals = np.empty(len(faces)), np.empty((len(faces), 3))
    for f in range(len(faces)):
        a, b, c = vertices[faces[f, 0]], vertices[faces[f, 1]], vertices[faces[f, 2]]
        across = cross(difference(b, a), difference(c, a))
        twice = length(across)
        areas[f] = 0.5 * twice
        for k in range(3):
            normals[f, k] = across[k] / twice
    return areas, normals


def refine(
    vertices_m: np.ndarray, normals: np.ndarray, faces: np.ndarray, max_edge_length_m: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Halve the longest edges of triangles until none is longer than wanted.

    An edge is halved for both its triangles at once, so no cracks open, and a triangle only ever
    together with its own longest edge, which keeps every angle above half the smallest one given
    (Rivara, Mesh refinement processes based on the generalized bisection of simplices, 1984);
    slivers are cut across instead. Unit normals (V, 3) go along and are interpolated, so that a
    coarse triangulation of a curved surface keeps the normals of the curve.

    Raises:
        MeshError: it would have more than MAX_TRIANGLES triangles.
    """
    longest_m = edge_lengths_m(vertices_m, faces).max(axis=1)
    if len(faces) <= MAX_TRIANGLES and not np.any(longest_m > max_edge_length_m):
        return vertices_m, normals, faces
    _refuse_too_many(face_areas_m2(vertices_m, faces), longest_m, max_edge_length_m)
    # Edges whose middles are known: once a sliver's edge was cut ahead of its neighbour's, this
    # has to meet them.
    keys: np.ndarray = np.empty(0, dtype=np.int64)
    middles: np.ndarray = keys
    while True:
        edges, of_face = edges_of(faces)
        length_m = np.empty(len(edges))
        length_m[of_face] = edge_lengths_m(vertices_m, faces)
        key, known = edges[:, 0] * KEY_BASE + edges[:, 1], np.full(len(edges), -1)
        row = np.minimum(np.searchsorted(key, keys), len(key) - 1)
        there = key[row] == keys
        known[row[there]] = middles[there]
        too_long = length_m > max_edge_length_m
        in_step = known.max() < 0
        if in_step and not too_long.any():
            return vertices_m, normals, faces
        # Slivers, whose sides are three times longer than their base, with both sides too long.
        base_m, side_m, _ = np.sort(length_m[of_face], axis=1).T
        thin = np.flatnonzero(side_m > np.maximum(3.0 * base_m, max_edge_length_m))
        if in_step and len(thin):
            parts = _parts(of_face[thin], length_m, max_edge_length_m)
            first = len(vertices_m) + np.cumsum(parts - 1) - (parts - 1)
            edge = np.repeat(np.arange(len(edges)), parts - 1)
            step = 1 + len(vertices_m) + np.arange(len(edge)) - first[edge]
            shares = (step / parts[edge])[:, None]
            vertices_m, normals = _with_points(vertices_m, normals, edges[edge], shares)
            keys, middles = _middles_of_cuts(edges, parts, first)
            pieces = _cut_slivers(faces[thin], of_face[thin], length_m, parts, first)
            faces = np.concatenate([np.delete(faces, thin, axis=0), pieces])
            continue
        halved = too_long | (known >= 0)
        longest = _close_under_longest(halved, length_m, of_face)
        new = halved & (known < 0)
        middle = np.where(new, len(vertices_m) + np.cumsum(new) - 1, known)
        vertices_m, normals = _with_points(vertices_m, normals, edges[new], 0.5)
        if len(keys):
            keys, middles = np.append(keys, key[new]), np.append(middles, middle[new])
        faces = _split(vertices_m, faces, middle[of_face], longest)


def _with_points(
    vertices_m: np.ndarray, normals: np.ndarray, edges: np.ndarray, share: np.ndarray | float
) -> tuple[np.ndarray, np.ndarray]:
    """The vertices and normals with a point on each edge (N, 2) more, a share (N, 1) along it."""
    start, end = edges.T
    points = (1.0 - share) * vertices_m[start] + share * vertices_m[end]
    between = (1.0 - share) * normals[start] + share * normals[end]
    between /= np.maximum(np.linalg.norm(between, axis=1, keepdims=True), 1e-12)
    return np.concatenate([vertices_m, points]), np.concatenate([normals, between])


def _middles_of_cuts(
    edges: np.ndarray, parts: np.ndarray, first: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Keys and middles of edges cut into equal parts, of their halves, and so on.

    ``parts`` (E,) are powers of two, 1 is uncut; ``first`` (E,) is the number of the inner vertex
    next to each edge's first end.
    """
    keys, middles = [], []
    for count in np.unique(parts[parts > 1]).tolist():
        cut = np.flatnonzero(parts == count)
        inner = first[cut][:, None] + np.arange(count - 1)
        points = np.concatenate([edges[cut, :1], inner, edges[cut, 1:]], axis=1)
        span = count
        while span > 1:
            ends = points[:, ::span]
            one, other = ends[:, :-1].ravel(), ends[:, 1:].ravel()
            keys.append(np.minimum(one, other) * KEY_BASE + np.maximum(one, other))
            middles.append(points[:, span // 2 :: span].ravel())
            span //= 2
    return np.concatenate(keys), np.concatenate(middles)


def _parts(of_slivers: np.ndarray, lengths_m: np.ndarray, max_edge_length_m: float) -> np.ndarray:
    """(E,) into how many parts edges are cut: those that are long sides of slivers (N, 3).

    Their pieces are as long as the base, though not shorter than the longest edge need be.
    """
    in_order = np.take_along_axis(of_slivers, lengths_m[of_slivers].argsort(axis=1), axis=1)
    piece_m = np.maximum(lengths_m[in_order[:, :1]], max_edge_length_m)
    sides = in_order[:, 1:]
    parts = np.ones(len(lengths_m), dtype=np.int64)
    # A power of two, so that halving the edges meets the same points.
    wanted = 2 ** np.ceil(np.log2(lengths_m[sides] / piece_m)).astype(np.int64)
    np.maximum.at(parts, sides, wanted)
    return parts


def _cut_slivers(
    slivers: np.ndarray,
    of_slivers: np.ndarray,
    lengths_m: np.ndarray,
    parts: np.ndarray,
    first: np.ndarray,
) -> np.ndarray:
    """Pieces (P, 3) of slivers (N, 3) whose sides (N, 3) are edges of lengths_m (E,).

    ``parts`` and ``first`` (E,) are as for ``_middles_of_cuts``.
    """
    base = lengths_m[of_slivers].argmin(axis=1)
    # From the tip opposite the base, with the same winding.
    turn = (base[:, None] + np.array([2, 0, 1])) % 3
    rows = np.arange(len(slivers))[:, None]
    corners = slivers[rows, turn]
    sides = of_slivers[rows, turn][:, [0, 2]]  # left and right of the tip
    counts = parts[sides]
    pieces = []
    for both in np.unique(counts, axis=0):
        some = (counts == both).all(axis=1)
        tip, *ends = corners[some].T
        vertices = [tip[:, None]]
        for end, edge, count in zip(ends, sides[some].T, both.tolist(), strict=True):
            steps = np.arange(count - 1)
            inner = np.where((tip < end)[:, None], steps, count - 2 - steps)
            vertices += [first[edge][:, None] + inner, end[:, None]]
        ladder = _ladder(*both.tolist())
        pieces.append(np.concatenate(vertices, axis=1)[:, ladder].reshape(-1, 3))
    return np.concatenate(pieces)


@lru_cache
def _ladder(left_parts: int, right_parts: int) -> np.ndarray:
    """(T, 3) triangles between two sides from one tip: vertices tip, left ones, right ones."""
    left = np.arange(left_parts + 1)
    right = np.concatenate([[0], left_parts + 1 + np.arange(right_parts)])
    i, j = 1, 1
    triangles = [(left[0], left[1], right[1])]
    while i < left_parts or j < right_parts:
        if i < left_parts and (i + 1) * right_parts <= (j + 1) * left_parts:
            triangles.append((left[i], left[i + 1], right[j]))
            i += 1
        else:
            triangles.append((left[i], right[j + 1], right[j]))
            j += 1
    return np.array(triangles)


@njit(cache=True, nogil=True)
def _close_under_longest(halved, length_m, of_face):
    """Add to the (E,) edges to halve the longest of every triangle that is touched.

    Returned is (F,) 0 to 2, the longest edge; of equal ones that of higher number: neighbours
    agree.
    """
    longest = np.zeros(len(of_face), dtype=np.int64)
    for f in range(len(of_face)):
        for k in (1, 2):
            best, other = of_face[f, longest[f]], of_face[f, k]
            longer = length_m[other] > length_m[best]
            if longer or (length_m[other] == length_m[best] and other > best):
                longest[f] = k
    changed = True
    while changed:
        changed = False
        for f in range(len(of_face)):
            own = of_face[f, longest[f]]
            if not halved[own] and (
                halved[of_face[f, 0]] or halved[of_face[f, 1]] or halved[of_face[f, 2]]
            ):
                halved[own] = changed = True
    return longest


def _split(
    vertices_m: np.ndarray, faces: np.ndarray, middle: np.ndarray, longest: np.ndarray
) -> np.ndarray:
    """Cut triangles at the middles of their edges.

    ``middle`` (F, 3) has the vertex in the middle of each edge, -1 where that stays whole; the
    longest is halved wherever another is.
    """
    kept = middle.max(axis=1) < 0
    rows = np.flatnonzero(~kept)
    turn = (longest[rows, None] + np.arange(3)) % 3
    a, b, c = faces[rows[:, None], turn].T
    m, p, q = middle[rows[:, None], turn].T
    bc, ca = p >= 0, q >= 0
    one = ~bc & ~ca
    # What is left are quadrilaterals (Q, 4), each cut along its shorter diagonal.
    quads = np.stack([m, np.where(bc, p, b), c, np.where(ca, q, a)], axis=1)[~one]
    w, x, y, z = vertices_m[quads].transpose(1, 0, 2)
    straight = np.linalg.norm(w - y, axis=1) <= np.linalg.norm(x - z, axis=1)
    quads = np.where(straight[:, None], quads, np.roll(quads, -1, axis=1))
    return np.concatenate(
        [
            faces[kept],
            np.stack([m, b, c], axis=1)[one],
            np.stack([a, m, c], axis=1)[one],
            np.stack([m, b, p], axis=1)[bc],
            np.stack([a, m, q], axis=1)[ca],
            quads[:, [0, 1, 2]],
            quads[:, [0, 2, 3]],
        ]
    )


def _refuse_too_many(areas_m2: np.ndarray, longest_m: np.ndarray, edge_m: float) -> None:
    """By the areas (F,) and longest edges (F,) of the triangles."""
    if len(areas_m2) > MAX_TRIANGLES:
        raise MeshError(
            f'the mesh has {len(areas_m2)} triangles, more than {MAX_TRIANGLES}; export it coarser'
        )
    # Halving ends between half the length and the length: up to 8 triangles an edge squared.
    by_area = 8.0 * areas_m2 / edge_m**2
    expected = float(np.maximum(np.maximum(by_area, 4.0 * longest_m / edge_m), 1.0).sum())
    if expected > MAX_TRIANGLES:
        raise MeshError(
            f'max_edge_length_m = {edge_m:g} m would cut this mesh into about {expected:.2g} '
            'triangles; give an edge length of at least '
            f'{edge_m * np.sqrt(expected / MAX_TRIANGLES):.2g} m'
        )
