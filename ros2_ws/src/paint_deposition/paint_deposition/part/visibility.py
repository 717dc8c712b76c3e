"""Lines of sight: which points a gun sees, and how much of the sky a point sees (Embree)."""

from collections.abc import Callable
from functools import cached_property
from threading import Lock

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from paint_deposition.part.curvature import tangents
from paint_deposition.part.face_tree import FaceTree
from paint_deposition.part.horizon import horizon_sines
from paint_deposition.part.points import box_centre_m

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
        tree: gives the one of its faces; asked for it with the first ray.
    """

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
        """Whether nothing of the part lies between.

        Args:
            eyes_m, points_m: (..., 3) eyes, and points on the part, of shapes that go together
                [m].

        Returns:
            (...,) bool. A point's own surroundings within CLEARANCE_M do not hide it, nor does
            surface that is seen from behind: incidence is the projection's business.
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
        """(N,) sine of the elevation above which nothing of the part hides a point.

        See ``horizon.horizon_sines``.
        """
        return horizon_sines(self._tree(), points_m, normals)

    def sky_view_factor(self, points_m: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """(N,) cosine-weighted share of the hemisphere over each point that the part leaves free.

        1 on flat and convex surface. The fixed set of SKY_RAYS directions resolves 0.002 where
        only the lowest sky is hidden, as in the shallow recesses of a door.
        """
        sky, weights = _sky()
        horizon = self.horizon_sines(points_m, normals)
        open_share = np.empty(len(points_m))
        rows = BLOCK_RAYS // SKY_RAYS
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
    t = (stratum + (azimuth * _GOLDEN_RATIO) % 1.0) / ELEVATIONS
    angle = 2.0 * np.pi * (azimuth + 0.5) / AZIMUTHS
    across = np.sqrt(1.0 - t**2)
    return np.stack([across * np.cos(angle), across * np.sin(angle), t]), t / t.sum()
