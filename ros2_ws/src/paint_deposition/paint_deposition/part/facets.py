"""How far the facets of a mesh are from the curved surface that they stand for.

Between two corners the refined mesh is straight, and its normals turn evenly. A curve through the
corners does neither. Its slope against the edge, averaged along the edge, is zero, since it leaves
one corner and arrives at the other. The corners' normals say what the slope is at both ends; with
a parabola for the slope in between, which has that average, the curve's middle is known:

    lean = (n_a + n_b) . e / 2           slope that an even turn has on average, to be taken away
    normal in the middle:  n - 1.5 lean e
    point in the middle:   + length turn / 8 along n,   turn = (n_b - n_a) . e

with e along the edge (Vlachos et al., Curved PN triangles, 2001, for the same parabola). On a
plane both are zero. Where the curvature begins or ends, the corners' normals are off themselves,
and lean shows that, too.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from paint_deposition.part.edges import BLOCK, next_half_edge

# Edges with less of both, in radians and as a share of a gun's distance, cost next to nothing.
LEAST_ERROR = 5e-4
GUN_M = 0.3
# What a shorter edge costs lies within the spot of a gauge: fillets and hems.
MOST_EDGES = 5_000


@dataclass(frozen=True)
class CurvedEdges:
    """Middles of the E edges of a mesh at which it is furthest from a curve."""

    # (E, 3) as the refined mesh has them [m], and outward unit normals.
    middles_m: np.ndarray
    normals: np.ndarray
    # (E, 3) as the curve has them.
    curved_m: np.ndarray
    curved_normals: np.ndarray
    lengths_m: np.ndarray  # (E,) of the edges as they were read [m]
    turns_rad: np.ndarray  # (E,) by which the normals turn along the edge [rad]

    def __len__(self) -> int:
        return len(self.lengths_m)

    def turned(self) -> 'CurvedEdges':
        """The edges as seen from the surface's other side."""
        return replace(self, normals=-self.normals, curved_normals=-self.curved_normals)

    def off_at(self, positions_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far the curve is from the mesh at points on it, and by how much the normals turn.

        What an edge's middle has fades toward its ends: at corners both are right. (P, 3) each, to
        be added to positions [m] and normals.
        """
        if not len(self):
            return np.zeros_like(positions_m), np.zeros_like(positions_m)
        # A point within a triangle lies near the middles of its sides, and of few others.
        near = min(8, len(self))
        away_m, edge = scipy.spatial.cKDTree(self.middles_m).query(positions_m, range(1, near + 1))
        fading = np.clip(1.0 - (2.0 * away_m / self.lengths_m[edge]) ** 2, 0.0, None) ** 2
        off_m, turns = self.curved_m - self.middles_m, self.curved_normals - self.normals
        return (
            np.einsum('pk,pkx->px', fading, off_m[edge]),
            np.einsum('pk,pkx->px', fading, turns[edge]),
        )

    @staticmethod
    def of(
        vertices_m: np.ndarray, normals: np.ndarray, faces: np.ndarray, half_edges: np.ndarray
    ) -> 'CurvedEdges':
        """Find them on the triangles of a file, whose smooth patches have corners of their own.

        Of each edge one of its half-edges is given, or both.

        Facets that meet at a crease, see ``creases.CREASE_RAD``, have corners and normals of their
        own there: a crease is no curve. So is a curve that is drawn with facets at such angles.
        """
        bent = []
        for some in np.array_split(half_edges, 1 + len(half_edges) // BLOCK):
            edges = faces.ravel()[np.stack([some, next_half_edge(some)], axis=1)]
            bent.append(edges[_bends(vertices_m, normals, edges)[0] > LEAST_ERROR])
        edges = np.unique(np.sort(np.concatenate(bent), axis=1), axis=0)
        worst_first = np.argsort(-_bends(vertices_m, normals, edges)[0], kind='stable')
        edges = edges[worst_first[:MOST_EDGES]]
        _, lengths, lean, sagitta = _bends(vertices_m, normals, edges)
        start, end = edges.T
        along = (vertices_m[end] - vertices_m[start]) / lengths[:, None]
        normal = _unit(normals[start] + normals[end])
        middle = 0.5 * (vertices_m[start] + vertices_m[end])
        return CurvedEdges(
            middle,
            normal,
            middle + sagitta[:, None] * normal,
            _unit(normal - 1.5 * lean[:, None] * along),
            lengths,
            np.arccos(np.clip(np.einsum('ij,ij->i', normals[start], normals[end]), -1.0, 1.0)),
        )


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
    cost = 1.5 * np.abs(lean) + 2.0 * np.abs(sagitta) / GUN_M
    # What a shorter edge costs lies within the spot of a gauge: fillets and hems.
    return np.where(length < 0.004, 0.0, cost), length, lean, sagitta


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12)


NO_EDGES = CurvedEdges(*[np.empty((0, 3))] * 4, *[np.empty(0)] * 2)
