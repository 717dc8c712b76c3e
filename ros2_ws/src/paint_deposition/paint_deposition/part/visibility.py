"""Lines of sight: which points a gun sees, and how much of the sky a point sees (Embree)."""

from functools import cached_property

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from paint_deposition.part.curvature import tangents

# The last bit of a ray before the point that it goes to, and how far above the surface a ray
# starts.
CLEARANCE_M = 5e-4
LIFT_M = 1e-4
AZIMUTHS, ELEVATIONS = 32, 8
SKY_RAYS = AZIMUTHS * ELEVATIONS
FAR_M = 1e3
BLOCK_RAYS = 1_000_000
_GOLDEN_RATIO = 0.5 * (np.sqrt(5.0) - 1.0)


class Occluder:
    """The part as an obstacle to rays.

    Args:
        vertices_m: (V, 3) [m].
        faces: (F, 3).
    """

    def __init__(self, vertices_m: np.ndarray, faces: np.ndarray) -> None:
        # Embree works in single precision: keep coordinates small.
        self._origin_m = 0.5 * (vertices_m.min(axis=0) + vertices_m.max(axis=0))
        self._corners = (vertices_m - self._origin_m).astype(np.float32)
        self._triangles = faces.astype(np.int32)

    @cached_property
    def _scene(self) -> EmbreeScene:
        """Made with the first ray: it takes a second for a million triangles."""
        scene = EmbreeScene(robust=True)
        # The scene does not keep the mesh alive by itself.
        self._mesh = TriangleMesh(scene, self._corners, self._triangles)
        return scene

    def visible(self, origins_m: np.ndarray, points_m: np.ndarray) -> np.ndarray:
        """Whether nothing of the part lies between.

        Args:
            origins_m: (M, 3) eyes [m].
            points_m: (V, 3) points on the part [m].

        Returns:
            (M, V) bool. A point's own surroundings within CLEARANCE_M do not hide it, nor does
            surface that is seen from behind: incidence is the projection's business.
        """
        origins_m, points_m = np.atleast_2d(origins_m), np.atleast_2d(points_m)
        seen = np.empty((len(origins_m), len(points_m)), dtype=bool)
        rows = max(1, BLOCK_RAYS // max(1, len(points_m)))
        for start in range(0, len(origins_m), rows):
            eyes = origins_m[start : start + rows, None, :]
            way = points_m - eyes
            length = np.linalg.norm(way, axis=2)
            direction = way / np.maximum(length, 1e-12)[:, :, None]
            starts = np.broadcast_to(eyes, way.shape)
            seen[start : start + rows] = ~self._blocked(
                starts.reshape(-1, 3), direction.reshape(-1, 3), length.ravel() - CLEARANCE_M
            ).reshape(length.shape)
        return seen

    def sky_view_factor(self, points_m: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """(N,) cosine-weighted share of the hemisphere over each point that the part leaves free.

        1 on flat and convex surface. The fixed set of SKY_RAYS directions resolves 0.002 where
        only the lowest sky is hidden, as in the shallow recesses of a door.
        """
        sky, weights = _sky()
        open_share = np.empty(len(points_m))
        rows = BLOCK_RAYS // SKY_RAYS
        for start in range(0, len(points_m), rows):
            up = normals[start : start + rows]
            frame = np.stack([*tangents(up), up])
            direction = np.einsum('ks,kni->nsi', sky, frame).reshape(-1, 3)
            starts = np.repeat(points_m[start : start + rows] + LIFT_M * up, SKY_RAYS, axis=0)
            blocked = self._blocked(starts, direction, np.full(len(starts), FAR_M))
            open_share[start : start + rows] = 1.0 - blocked.reshape(-1, SKY_RAYS) @ weights
        return open_share

    def first_faces(self, starts_m: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """(N,) the triangle that each ray meets first, -1 for none."""
        return self._scene.run(
            (starts_m - self._origin_m).astype(np.float32), directions.astype(np.float32)
        )

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
    t = (stratum + (azimuth * _GOLDEN_RATIO) % 1.0) / ELEVATIONS
    angle = 2.0 * np.pi * (azimuth + 0.5) / AZIMUTHS
    across = np.sqrt(1.0 - t**2)
    return np.stack([across * np.cos(angle), across * np.sin(angle), t]), t / t.sum()
