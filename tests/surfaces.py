"""Surfaces of known shape, triangulated as one likes."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import trimesh
from scipy.spatial import Delaunay

from paint_deposition.part.edges import matched_half_edges
from paint_deposition.part.surface import Surface

Depth = Callable[[np.ndarray, np.ndarray], np.ndarray]


def on_grid(points_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces over a grid of points (I, J, 3).

    They are wound from the first index to the second: over x and z outward to -y.
    """
    corner = np.arange(points_m[..., 0].size).reshape(points_m.shape[:2])
    a, b, c, d = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
    faces = [np.stack(three, axis=2).reshape(-1, 3) for three in ((a, b, c), (a, c, d))]
    return points_m.reshape(-1, 3), np.concatenate(faces)


def triangulated(
    depth: Depth,
    spacing_m: float,
    half_width_m: float = 0.2,
    half_height_m: float | None = None,
    jitter: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of the surface y = depth(x, z), outward to -y.

    ``jitter`` moves the grid's vertices by that share of the spacing, those on the rim along it.
    """
    rng = np.random.default_rng(7)
    half = np.array([half_width_m, half_height_m or half_width_m])
    counts = np.maximum(2, np.round(2 * half / spacing_m).astype(int)) + 1
    lines = [np.linspace(-h, h, count) for h, count in zip(half, counts, strict=True)]
    flat = np.stack(np.meshgrid(*lines, indexing='ij'), axis=2).reshape(-1, 2)
    inner = np.abs(flat) < half - 1e-9
    flat = flat + inner * rng.uniform(-jitter, jitter, flat.shape) * spacing_m
    faces = Delaunay(flat).simplices
    a, b, c = flat[faces].transpose(1, 0, 2)
    doubled = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    faces = np.where(doubled[:, None] > 0, faces, faces[:, ::-1])
    faces = faces[np.abs(doubled) > 1e-6 * spacing_m**2]
    x, z = flat.T
    return np.stack([x, depth(x, z), z], axis=1), faces


def refined(depth: Depth, spacing_m: float, max_edge_length_m: float = 0.01, **shape) -> Surface:
    """The surface of ``triangulated``, its edges no longer than that."""
    return Surface.from_triangles(*triangulated(depth, spacing_m, **shape), max_edge_length_m)


def sheet(depth: Depth, half_m: float = 0.5, count: int = 41) -> Surface:
    """The surface y = depth(x, z) over a square, outward to -y, on a grid of so many lines."""
    line = np.linspace(-half_m, half_m, count)
    x, z = np.meshgrid(line, line, indexing='ij')
    return Surface.from_triangles(*on_grid(np.stack([x, depth(x, z), z], axis=2)), 0.05)


def flat(x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """A plane."""
    return np.zeros_like(x)


def cylinder(radius_m: float) -> Depth:
    """Part of a level cylinder of signed radius, bulging toward the gun if positive."""
    return lambda x, z: np.sign(radius_m) * (abs(radius_m) - np.sqrt(radius_m**2 - z**2))


def ball(radius_m: float) -> Depth:
    """Part of a ball of signed radius, bulging toward the gun if positive."""
    return lambda x, z: np.sign(radius_m) * (abs(radius_m) - np.sqrt(radius_m**2 - x**2 - z**2))


def fold(lean_rad: float) -> Depth:
    """Two planes that meet at z = 0 and each lean back by an angle; negative: a groove."""
    return lambda x, z: np.abs(z) * np.tan(lean_rad)


def solid(
    vertices_m: np.ndarray, faces: np.ndarray, thickness_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """Close a sheet: an inner surface behind it, along its normals, and a rim."""
    outward = trimesh.Trimesh(vertices_m, faces, process=False).vertex_normals
    inner = vertices_m - thickness_m * outward
    count = len(vertices_m)
    edges = matched_half_edges(faces)[2]
    start, end = faces.ravel()[edges], np.roll(faces, -1, axis=1).ravel()[edges]
    rim = np.concatenate(
        [np.stack([end, start, start + count], 1), np.stack([end, start + count, end + count], 1)]
    )
    return np.concatenate([vertices_m, inner]), np.concatenate(
        [faces, faces[:, ::-1] + count, rim]
    )


def hemmed(
    vertices_m: np.ndarray, faces: np.ndarray, thickness_m: float, facets: int
) -> tuple[np.ndarray, np.ndarray]:
    """Close a sheet of ``triangulated`` with an inner surface behind it in y and a round rim.

    The round is a half circle as wide as the sheet is thick, cut into so many facets.
    """
    edges = matched_half_edges(faces)[2]
    following = dict(
        zip(faces.ravel()[edges], np.roll(faces, -1, axis=1).ravel()[edges], strict=True)
    )
    ring = [int(faces.ravel()[edges[0]])]
    while len(ring) < len(following):
        ring.append(int(following[ring[-1]]))
    rim = vertices_m[ring]
    aside = np.where(np.abs(rim) > np.abs(rim).max(axis=0) - 1e-9, np.sign(rim), 0.0)
    aside[:, 1] = 0.0
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    count = len(vertices_m)
    placed = [vertices_m, vertices_m + np.array([0.0, thickness_m, 0.0])]
    rows = [np.array(ring)]
    for angle in np.pi * np.arange(1, facets) / facets:
        rows.append(2 * count + len(ring) * (len(rows) - 1) + np.arange(len(ring)))
        back = np.array([0.0, 1.0 - np.cos(angle), 0.0])
        placed.append(rim + 0.5 * thickness_m * (np.sin(angle) * aside + back))
    rows.append(np.array(ring) + count)
    triangles = [faces, faces[:, ::-1] + count]
    for front, behind in pairwise(rows):
        ahead, ahead_behind = np.roll(front, -1), np.roll(behind, -1)
        triangles.append(np.stack([ahead, front, behind], axis=1))
        triangles.append(np.stack([ahead, behind, ahead_behind], axis=1))
    return np.concatenate(placed), np.concatenate(triangles)
