"""How high the part stands around its points, against shapes whose horizon is known."""

import numpy as np
import pytest
from trimesh.creation import box
from trimesh.util import concatenate

from paint_deposition.part.surface import Surface
from paint_deposition.part.visibility import HIGH_SINE, LEAST_SINE, SLACK_SINE


def horizon_sines(surface, rows=slice(None)):
    return surface.occluder.horizon_sines(surface.vertices_m[rows], surface.normals[rows])


def test_nothing_stands_over_convex_surface(make_surface, ball):
    """Facets lean by half of what the ball turns from one vertex to the next, no more."""
    found = horizon_sines(make_surface(ball(0.4), 0.02))
    assert found.min() == LEAST_SINE
    assert found.max() < SLACK_SINE + 0.5 * 0.03 / 0.4


@pytest.mark.parametrize('radius_m', [0.3, 0.6])
def test_the_rim_of_a_bowl(make_surface, ball, radius_m):
    """From the bottom of a bowl its corners stand under half the angle that they span."""
    half_m = 0.2
    bowl = make_surface(ball(-radius_m), 0.02, half_width_m=half_m)
    bottom = np.argmin(np.hypot(bowl.vertices_m[:, 0], bowl.vertices_m[:, 2]))
    sine = np.sin(0.5 * np.arcsin(np.sqrt(2.0) * half_m / radius_m))
    (found,) = horizon_sines(bowl, [bottom])
    assert sine <= found <= sine + 1.1 * SLACK_SINE


@pytest.mark.parametrize('opening_deg', [95.0, 140.0])
def test_the_lip_of_a_groove(make_surface, fold, opening_deg):
    half = np.radians(opening_deg) / 2
    slant_m = 0.1
    groove = make_surface(
        fold(half - np.pi / 2), 0.1, 0.02, half_width_m=0.3, half_height_m=slant_m * np.sin(half)
    )
    # Of the upper wall: straight across lies the nearest of the other lip, under the highest sine.
    on_wall = (groove.vertices_m[:, 2] > 0.01) & (np.abs(groove.vertices_m[:, 0]) < 0.01)
    assert on_wall.sum() > 5
    places, normals = groove.vertices_m[on_wall], groove.normals[on_wall]
    to_lip = np.array([0.0, -slant_m * np.cos(half), -slant_m * np.sin(half)]) - places
    to_lip[:, 0] = 0.0
    sine = np.einsum('ij,ij->i', to_lip, normals) / np.linalg.norm(to_lip, axis=1)
    found = horizon_sines(groove, on_wall)
    np.testing.assert_array_less(sine - 1e-9, found)
    high = sine > HIGH_SINE
    np.testing.assert_array_equal(found[high], 1.0)
    np.testing.assert_array_less(found[~high], sine[~high] + 1.1 * SLACK_SINE)


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
