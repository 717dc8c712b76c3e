"""Normals are those of the curved surface, whatever its triangulation."""

import numpy as np
import pytest
from trimesh.creation import box

from paint_deposition.part.surface import Surface


def normals_off_rad(surface, exact):
    """Angle between the surface's normals and the exact ones at its vertices."""
    wanted = exact(surface.vertices_m)
    return np.linalg.norm(np.cross(surface.normals, wanted), axis=1)


def ball_normals(radius_m):
    """Outward normals of a ball whose foremost point is the origin."""

    def exact(points):
        way = points - np.array([0.0, radius_m, 0.0])
        return way / np.linalg.norm(way, axis=1, keepdims=True)

    return exact


def test_a_plane_is_exact(make_surface, flat):
    surface = make_surface(flat, 0.05, jitter=0.35)
    np.testing.assert_allclose(surface.normals, np.tile([0.0, -1, 0], (len(surface.normals), 1)))


@pytest.mark.parametrize(
    ('spacing_m', 'jitter', 'rms_deg'), [(0.01, 0.0, 0.001), (0.04, 0.35, 0.02), (0.1, 0.35, 0.2)]
)
def test_a_ball_up_to_the_rim(make_surface, ball, spacing_m, jitter, rms_deg):
    surface = make_surface(ball(0.8), spacing_m, half_width_m=0.4, jitter=jitter)
    off = np.degrees(normals_off_rad(surface, ball_normals(0.8)))
    assert np.sqrt(np.mean(off**2)) < rms_deg
    assert off.max() < 5 * rms_deg


def test_a_box_keeps_its_edges_sharp():
    body = box((0.3, 0.2, 0.1))
    surface = Surface.from_triangles(body.vertices, np.asarray(body.faces), 0.02)
    assert surface.area_m2 == pytest.approx(body.area)
    np.testing.assert_allclose(np.abs(surface.normals).max(axis=1), 1.0)
    outward = np.einsum('ij,ij->i', surface.normals, surface.vertices_m)
    assert (outward > 0.0).all()
