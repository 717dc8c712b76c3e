"""Places closest to points, against another implementation."""

import numpy as np
from trimesh.triangles import closest_point

from paint_deposition.part.locating import closest_place


def test_places_inside_on_edges_and_at_corners_are_those_of_trimesh():
    rng = np.random.default_rng(0)
    vertices, faces = rng.normal(size=(300, 3)), np.arange(300).reshape(-1, 3)
    face, points = np.repeat(np.arange(100), 50), rng.normal(size=(5000, 3))
    corners = vertices[faces[face]]
    points[:500], points[500:1000] = corners[:500, 1], corners[500:1000, 1:].mean(axis=1)
    points[1000:1500] = corners[1000:1500].mean(axis=1)
    places = [
        closest_place(*map(tuple, (*its, point)))
        for its, point in zip(corners, points, strict=True)
    ]
    np.testing.assert_allclose(places, closest_point(corners, points), atol=1e-12)
