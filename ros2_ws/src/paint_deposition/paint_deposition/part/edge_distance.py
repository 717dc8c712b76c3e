"""Distance to the free edges of the surface, and which edges are free."""

import numpy as np
import scipy

# Pieces of edges so short that the nearest has one of the nearest middles [m].
PIECE_M = 0.002
CANDIDATES = 4
# Patches of a CAD model are often triangulated apart; gaps up to this are no edges of the surface.
SEAM_M = 3e-4
SEAM_COSINE = -0.9


def edge_distance_m(points_m: np.ndarray, rim_m: np.ndarray) -> np.ndarray:
    """(N,) straight distance to the nearest of the (B, 2, 3) rim segments, inf without any [m]."""
    if not len(rim_m):
        return np.full(len(points_m), np.inf)
    pieces = cut_segments(rim_m, PIECE_M)[0]
    middles = scipy.spatial.cKDTree(pieces.mean(axis=1))
    near = middles.query(points_m, k=min(CANDIDATES, len(pieces)))[1]
    near = near.reshape(len(points_m), -1)
    return _distance_m(points_m[:, None, :], pieces[near]).min(axis=1)


def without_seams(segments_m: np.ndarray) -> np.ndarray:
    """Leave out edges of triangles along which another patch of the surface goes on.

    Args:
        segments_m: (B, 2, 3) unpaired edges, each in the sense in which its triangle runs [m]:
            the two sides of a seam run against each other.
    """
    if not len(segments_m):
        return segments_m
    pieces, segment = cut_segments(segments_m, PIECE_M)
    middles = segments_m.mean(axis=1)
    reach_m = 0.5 * PIECE_M + SEAM_M
    near = scipy.spatial.cKDTree(middles).sparse_distance_matrix(
        scipy.spatial.cKDTree(pieces.mean(axis=1)), reach_m, output_type='ndarray'
    )
    one, piece = near['i'], near['j']
    along = segments_m[:, 1] - segments_m[:, 0]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    against = np.einsum('ni,ni->n', along[one], along[segment[piece]]) < SEAM_COSINE
    touching = _distance_m(middles[one], pieces[piece]) < SEAM_M
    free = np.ones(len(segments_m), dtype=bool)
    free[one[against & touching]] = False
    return segments_m[free]


def _distance_m(points_m: np.ndarray, segments_m: np.ndarray) -> np.ndarray:
    """(...) distances of points (..., 3) from segments (..., 2, 3) [m]."""
    way = points_m - segments_m[..., 0, :]
    along = segments_m[..., 1, :] - segments_m[..., 0, :]
    length2 = np.maximum(np.sum(along * along, axis=-1), 1e-30)
    share = np.clip(np.sum(way * along, axis=-1) / length2, 0.0, 1.0)
    return np.linalg.norm(way - share[..., None] * along, axis=-1)


def cut_segments(segments_m: np.ndarray, longest_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Equal pieces (P, 2, 3) no longer than wanted of (B, 2, 3) segments, and (P,) whose."""
    along = segments_m[:, 1] - segments_m[:, 0]
    count = np.maximum(1, np.ceil(np.linalg.norm(along, axis=1) / longest_m)).astype(int)
    segment = np.repeat(np.arange(len(segments_m)), count)
    step = np.arange(len(segment)) - np.repeat(np.cumsum(count) - count, count)
    ends = (step[:, None] + np.array([0.0, 1.0])) / count[segment][:, None]
    start = segments_m[segment, 0][:, None, :]
    return start + ends[:, :, None] * along[segment][:, None, :], segment
