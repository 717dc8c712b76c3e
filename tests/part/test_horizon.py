"""How high the part stands around its points, against shapes whose horizon is known."""

import numpy as np
from trimesh.creation import box
from trimesh.util import concatenate

from paint_deposition.part.surface import Surface
from paint_deposition.part.visibility import LEAST_SINE, SLACK_SINE


def horizon_sines(surface, rows=slice(None)):
    return surface.occluder.horizon_sines(surface.vertices_m[rows], surface.normals[rows])


def test_nothing_stands_over_convex_surface(make_surface, ball):
    """Facets lean by half of what the ball turns from one vertex to the next, no more."""
    found = horizon_sines(make_surface(ball(0.4), 0.02))
    assert found.min() == LEAST_SINE
    assert found.max() < SLACK_SINE + 0.5 * 0.03 / 0.4


def test_a_bar_overhead_is_the_highest_horizon():
    wall = box((1.0, 0.01, 1.0))
    bar = box((0.1, 0.01, 0.1))
    bar.apply_translation([0.0, -0.2, 0.0])
    both = concatenate([wall, bar])
    surface = Surface.from_triangles(both.vertices, np.asarray(both.faces), 0.02)
    front = np.isclose(surface.vertices_m[:, 1], -0.005) & (surface.normals[:, 1] < -0.9)
    below = front & (np.abs(surface.vertices_m[:, [0, 2]]).max(axis=1) < 0.049)
    np.testing.assert_array_equal(horizon_sines(surface, below), 1.0)


def test_whoever_stands_over_the_horizon_is_seen(make_surface):
    """On rough ground no ray from above the horizon meets anything."""
    rng = np.random.default_rng(3)
    waves = rng.normal(0.0, 30.0, (12, 2))

    def rough(x, z):
        return 0.002 * sum(np.sin(a * x + b * z + k) for k, (a, b) in enumerate(waves))

    ground = make_surface(rough, 0.01, jitter=0.3)
    rows = rng.integers(len(ground.vertices_m), size=4000)
    eyes = np.stack([
        rng.uniform(-0.4, 0.4, 4000), rng.uniform(-0.3, -0.03, 4000), rng.uniform(-0.4, 0.4, 4000)
    ], axis=1)  # fmt: skip
    places = ground.vertices_m[rows]
    way = eyes - places
    sine = np.einsum('ij,ij->i', way, ground.normals[rows]) / np.linalg.norm(way, axis=1)
    above = sine > horizon_sines(ground, rows)
    seen = ground.occluder.sees(eyes, places)
    assert above.sum() > 500
    assert (~seen[sine > 0.0]).sum() > 100
    assert seen[above].all()
    # The horizon is no higher than it must be: half of all that is seen from in front is above.
    assert above[seen & (sine > 0.0)].mean() > 0.5
