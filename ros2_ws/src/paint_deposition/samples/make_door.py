#!/usr/bin/env python3
"""Draw the sample parts: ``door.stl``, the outside of a truck door, and ``panel.stl``, a flat one.

    python3 make_door.py [FOLDER]

The door stands in x (along the vehicle, front at -x) and z (up) and turns its outward side to -y,
where the gun is. It has the features of the door in Conner et al. (2002), section 4.3: a line of
convex curvature near the middle and a pronounced concave bottom third. Lengths in metres.
"""

import sys
from pathlib import Path

import numpy as np
from scipy.spatial import Delaunay

HALF_WIDTH_M = 0.6
SPACING_M = 0.0165

CROWN_RADIUS_M = 4.0  # front to rear
LEAN = 0.04  # of the upper half, at the feature line, away from the gun
UPPER_CURVATURE_PER_M = 0.15

FEATURE_LINE_HEIGHT_M = 0.48
FEATURE_LINE_RISE = 0.05  # towards the rear
FEATURE_LINE_TURN = 0.30  # change of slope across it
FEATURE_LINE_WIDTH_M = 0.018

VALLEY_HEIGHT_M = 0.17
VALLEY_TURN = 0.62
VALLEY_WIDTH_M = 0.07


def ramp(t: np.ndarray) -> np.ndarray:
    """Integral of (1 + tanh t) / 2: zero far below 0, t far above, smooth between."""
    return 0.5 * np.logaddexp(0.0, 2.0 * t)


def crown(x: np.ndarray) -> np.ndarray:
    """Front and rear end stand back."""
    return x**2 / (2.0 * CROWN_RADIUS_M)


def upper_lean(z: np.ndarray) -> np.ndarray:
    """The surface leans inward to the window, a little more the higher."""
    above = z - FEATURE_LINE_HEIGHT_M
    return LEAN * above + 0.5 * UPPER_CURVATURE_PER_M * above**2


def feature_line_height(x: np.ndarray) -> np.ndarray:
    return FEATURE_LINE_HEIGHT_M + FEATURE_LINE_RISE * x


def feature_line(x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Below the feature line the surface turns away from the gun: the convex line."""
    below = (feature_line_height(x) - z) / FEATURE_LINE_WIDTH_M
    return FEATURE_LINE_TURN * FEATURE_LINE_WIDTH_M * ramp(below)


def valley(x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """At the bottom it comes back out to the rocker: the concave third, deepest at mid door."""
    turn = VALLEY_TURN * (1.0 - 0.12 * (x / HALF_WIDTH_M) ** 2)
    return -turn * VALLEY_WIDTH_M * ramp((VALLEY_HEIGHT_M - z) / VALLEY_WIDTH_M)


def door_depth(x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Y of the surface [m], larger away from the gun."""
    return crown(x) + upper_lean(z) + feature_line(x, z) + valley(x, z)


def door_outline() -> np.ndarray:
    """(N, 2) convex outline in x-z, anticlockwise: rounded corners, window line bowed up."""
    corners = np.array([[-0.58, 0.0], [0.6, 0.0], [0.56, 0.87], [-0.6, 0.83]])
    radii = [0.09, 0.07, 0.05, 0.06]
    bows = [0.004, 0.006, 0.03, 0.006]
    sides = [
        bowed(start, end, bow)
        for start, end, bow in zip(corners, np.roll(corners, -1, axis=0), bows, strict=True)
    ]
    pieces = []
    for n, radius in enumerate(radii):
        before, after = sides[n - 1], sides[n]
        into = before[np.linalg.norm(before - corners[n], axis=1) > radius]
        out = after[np.linalg.norm(after - corners[n], axis=1) > radius]
        pieces.append(rounded(into[-1], corners[n], out[0]))
        end = np.linalg.norm(out - corners[(n + 1) % 4], axis=1) > radii[(n + 1) % 4]
        pieces.append(out[end])
    outline = np.concatenate(pieces)
    return evenly(np.concatenate([outline, outline[:1]]), SPACING_M, endpoint=False)


def bowed(start: np.ndarray, end: np.ndarray, bow_m: float) -> np.ndarray:
    """A side that bulges outward by bow_m in its middle."""
    t = np.linspace(0.0, 1.0, 2001)[:, None]
    way = end - start
    outward = np.array([way[1], -way[0]]) / np.linalg.norm(way)
    return start + t * way + 4.0 * bow_m * t * (1.0 - t) * outward


def rounded(
    start: np.ndarray, corner: np.ndarray, end: np.ndarray, points: int = 200
) -> np.ndarray:
    """A quadratic Bezier round the corner."""
    t = np.linspace(0.0, 1.0, points)[:, None]
    return (1 - t) ** 2 * start + 2 * t * (1 - t) * corner + t**2 * end


def evenly(line: np.ndarray, spacing_m: float, endpoint: bool = True) -> np.ndarray:
    """Points at equal distances along a line."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    at = np.linspace(0.0, along[-1], round(along[-1] / spacing_m), endpoint)
    return np.stack([np.interp(at, along, line[:, axis]) for axis in range(2)], axis=1)


def inside(outline: np.ndarray, points: np.ndarray, margin_m: float) -> np.ndarray:
    """Which points lie within a convex outline, further than a margin from it."""
    way = np.roll(outline, -1, axis=0) - outline
    inward = np.stack([-way[:, 1], way[:, 0]], axis=1)
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    depth = np.einsum('pki,ki->pk', points[:, None, :] - outline, inward)
    return (depth > margin_m).all(axis=1)


def triangular_grid(spacing_m: float) -> np.ndarray:
    """(N, 2) corners of equilateral triangles over the door and beyond."""
    rows = np.arange(-1, 65)[:, None] * spacing_m * np.sqrt(0.75)
    odd = (np.arange(-1, 65)[:, None] % 2) * 0.5
    x = (np.arange(-45, 46)[None, :] + odd) * spacing_m
    return np.stack([x, np.broadcast_to(rows, x.shape)], axis=2).reshape(-1, 2)


def door() -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) [m] and faces (F, 3) of the door, outward side to -y."""
    outline = door_outline()
    grid = triangular_grid(SPACING_M)
    flat = np.concatenate([outline, grid[inside(outline, grid, 0.55 * SPACING_M)]])
    faces = Delaunay(flat).simplices
    a, b, c = flat[faces].transpose(1, 0, 2)
    doubled = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    faces = np.where(doubled[:, None] > 0, faces, faces[:, ::-1])
    faces = faces[np.abs(doubled) > 1e-3 * SPACING_M**2]
    x, z = flat.T
    return np.stack([x, door_depth(x, z), z], axis=1), faces


def panel() -> tuple[np.ndarray, np.ndarray]:
    """A flat panel for three horizontal passes at 577 mm index, 0.8 m wide and 2 m high."""
    vertices = np.array([[-0.4, 0, 0], [0.4, 0, 0], [0.4, 0, 2.0], [-0.4, 0, 2.0]])
    return vertices, np.array([[0, 1, 2], [0, 2, 3]])


def main() -> None:
    from trimesh import Trimesh

    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    for name, (vertices, faces) in {'door': door(), 'panel': panel()}.items():
        Trimesh(vertices, faces, process=False).export(folder / f'{name}.stl')
        print(f'{name}.stl: {len(faces)} triangles')


if __name__ == '__main__':
    main()
