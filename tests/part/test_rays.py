"""What rays meet first, against every triangle tried and against Embree."""

import numpy as np
import pytest
from tests.surfaces import triangulated

from paint_deposition.part.surface import Surface


@pytest.fixture(scope='module')
def waves():
    vertices, faces = triangulated(
        lambda x, z: 0.05 * np.sin(20 * x) * np.cos(15 * z), 0.02, jitter=0.3
    )
    return Surface.from_triangles(vertices, faces, 0.05)


@pytest.fixture
def rays():
    rng = np.random.default_rng(3)
    return rng.uniform(-0.15, 0.15, (4000, 3)), rng.normal(size=(4000, 3))


def crossings(surface, start, way):
    """Where a ray crosses the plane of each triangle, inf beside the triangle or behind."""
    a, b, c = surface.vertices_m[surface.faces].transpose(1, 0, 2)
    columns = np.stack([b - a, c - a, np.broadcast_to(-way, a.shape)], axis=2)
    one, other, along = np.linalg.solve(columns, (start - a)[:, :, np.newaxis])[:, :, 0].T
    return np.where(
        (np.minimum(one, other) >= 0) & (one + other <= 1) & (along >= 0), along, np.inf
    )


def test_the_first_of_all_triangles_that_a_ray_crosses(waves, rays):
    starts, ways = (each[:300] for each in rays)
    met = waves.first_faces(starts, ways)
    for start, way, face in zip(starts, ways, met, strict=True):
        along = crossings(waves, start, way)
        assert face == (np.argmin(along) if np.isfinite(along.min()) else -1)
    assert 0.1 < np.mean(met >= 0) < 0.9
