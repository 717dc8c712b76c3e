"""Where points near the part lie on its surface."""

from dataclasses import dataclass

import numpy as np
import scipy
from numba import njit

# How much further away than the nearest surface the side that a normal points out of may be.
THICKNESS_M = 0.06
# Surface that leans further than this from the side that is painted is its back.
BACK_COSINE = -0.5
# Beyond this distance the place is only good to a triangle: nobody paints or measures there.
FAR_M = 0.3
FEW = 32
BLOCK = 2048


@dataclass(frozen=True)
class Location:
    """Places on the surface closest to N points.

    Attributes:
        positions_m: (N, 3) the places [m].
        normals: (N, 3) outward unit normals of the surface there.
        faces: (N,) triangle.
        weights: (N, 3) barycentric weights of its corners.
        distance_m: (N,) from the point to the place [m].
        angle_rad: (N,) between the point's own normal and the surface's, NaN where none was given.
    """

    positions_m: np.ndarray
    normals: np.ndarray
    faces: np.ndarray
    weights: np.ndarray
    distance_m: np.ndarray
    angle_rad: np.ndarray


class SurfaceLocator:
    """Finds closest places on a refined mesh.

    Args:
        vertices_m: (V, 3) [m].
        faces: (F, 3).
        normals: (V, 3) outward unit normals.
    """

    def __init__(self, vertices_m: np.ndarray, faces: np.ndarray, normals: np.ndarray) -> None:
        self._vertices_m, self._faces, self._normals = vertices_m, faces, normals
        # A corner at a time: all together take much memory on a fine mesh.
        self._centres = sum(vertices_m[corner] for corner in faces.T) / 3.0
        self._reach_m = max(
            float(np.linalg.norm(vertices_m[corner] - self._centres, axis=1).max())
            for corner in faces.T
        )
        self._tree = scipy.spatial.cKDTree(self._centres)

    def locate(
        self,
        points_m: np.ndarray,
        normals: np.ndarray | None = None,
        side: np.ndarray | None = None,
    ) -> Location:
        """See ``Surface.locate``.

        Args:
            points_m, normals: (N, 3).
            side: (3,) outward unit normal of the only side that is painted, or None; where there
                are no normals, its back is not taken.
        """
        points_m = np.asarray(points_m, dtype=np.float64).reshape(-1, 3)
        face = np.empty(len(points_m), dtype=np.int64)
        place = np.empty((len(points_m), 3))
        for start in range(0, len(points_m), BLOCK):
            block = slice(start, start + BLOCK)
            wanted = None if normals is None else np.asarray(normals, dtype=np.float64)[block]
            face[block], place[block] = self._closest(points_m[block], wanted, side)
        weights = _barycentric(self._vertices_m[self._faces[face]], place)
        outward = np.einsum('nk,nki->ni', weights, self._normals[self._faces[face]])
        outward /= np.linalg.norm(outward, axis=1, keepdims=True)
        distance = np.linalg.norm(points_m - place, axis=1)
        return Location(place, outward, face, weights, distance, _angle(outward, normals))

    def _closest(
        self, points_m: np.ndarray, normals: np.ndarray | None, side: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        nearest, few = self._tree.query(points_m, k=min(FEW, len(self._faces)))
        nearest, few = nearest.reshape(len(points_m), -1), few.reshape(len(points_m), -1)
        # No point of a triangle is further from its centre than the reach.
        radius = (
            nearest[:, 0]
            + self._reach_m
            + (0.0 if normals is None and side is None else THICKNESS_M)
        )
        far = nearest[:, 0] > FAR_M
        near = self._tree.query_ball_point(points_m, np.where(far, 0.0, radius))
        near = [few[n] if far[n] else faces for n, faces in enumerate(near)]
        point = np.repeat(np.arange(len(points_m)), [len(faces) for faces in near])
        face = np.concatenate([np.asarray(faces, dtype=np.int64) for faces in near])
        place = closest_places(self._vertices_m, self._faces, face, points_m, point)
        distance = np.linalg.norm(place - points_m[point], axis=1)
        if normals is not None or side is not None:
            facing = self._normals[self._faces[face]].mean(axis=1)
            if normals is not None:
                averse = np.einsum('ij,ij->i', facing, normals[point]) < 0.0
            else:
                averse = facing @ side < BACK_COSINE
            distance = distance + THICKNESS_M * averse
        order = np.lexsort((distance, point))
        first = order[np.unique(point[order], return_index=True)[1]]
        return face[first], place[first]


@njit(cache=True, nogil=True)
def closest_places(vertices, faces, face, points, point):
    """(P, 3) place on each of P triangles that is closest to a point.

    Ericson, Real-Time Collision Detection (2005), section 5.1.5. The function of trimesh does the
    same; loading trimesh for it takes longer than all that it computes here.

    Args:
        vertices, faces: (V, 3) [m] and (F, 3).
        face, point: (P,) rows of ``faces`` and of ``points``.
        points: (N, 3) [m].
    """
    places = np.empty((len(face), 3))
    ab, ac, ap = np.empty(3), np.empty(3), np.empty(3)
    for k in range(len(face)):
        a, b, c = faces[face[k]]
        d1, d2, abab, abac, acac = 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(3):
            ab[i], ac[i] = vertices[b, i] - vertices[a, i], vertices[c, i] - vertices[a, i]
            ap[i] = points[point[k], i] - vertices[a, i]
            d1, d2 = d1 + ab[i] * ap[i], d2 + ac[i] * ap[i]
            abab, abac, acac = abab + ab[i] ** 2, abac + ab[i] * ac[i], acac + ac[i] ** 2
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
        for i in range(3):
            places[k, i] = vertices[a, i] + v * ab[i] + w * ac[i]
    return places


def _barycentric(corners_m: np.ndarray, points_m: np.ndarray) -> np.ndarray:
    """(N, 3) weights of the corners (N, 3, 3) at points (N, 3) in their triangles."""
    a, b, c = corners_m.transpose(1, 0, 2)
    whole = np.cross(b - a, c - a)
    size2 = np.einsum('ij,ij->i', whole, whole)
    of_b = np.einsum('ij,ij->i', np.cross(points_m - a, c - a), whole) / size2
    of_c = np.einsum('ij,ij->i', np.cross(b - a, points_m - a), whole) / size2
    weights = np.clip(np.stack([1.0 - of_b - of_c, of_b, of_c], axis=1), 0.0, 1.0)
    return weights / weights.sum(axis=1, keepdims=True)


def _angle(outward: np.ndarray, normals: np.ndarray | None) -> np.ndarray:
    if normals is None:
        return np.full(len(outward), np.nan)
    normals = np.asarray(normals, dtype=np.float64)
    across = np.linalg.norm(np.cross(outward, normals), axis=1)
    return np.arctan2(across, np.einsum('ij,ij->i', outward, normals))
