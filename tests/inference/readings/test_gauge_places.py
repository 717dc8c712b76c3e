"""Where a gauge can stand."""

import numpy as np

from booth import panel
from paint_deposition.inference.readings import places
from paint_deposition.inference.readings.places import can_stand, from_edges_m
from paint_deposition.part.surface import Surface
from surfaces import triangulated


def folded(slope: float) -> Surface:
    """A sheet with a bend along z at x = 0, its radius 40 mm over the slope where it is slight."""

    def depth(x: np.ndarray, z: np.ndarray) -> np.ndarray:
        return slope * 0.01 * np.logaddexp(0.0, x / 0.01)

    return Surface.from_triangles(*triangulated(depth, 0.01), 0.02)


def test_a_foot_keeps_off_edges_and_does_not_stand_on_a_bend():
    inside = np.abs(panel().vertices_m[:, [0, 2]]).max(axis=1) < 0.5 - 0.03
    np.testing.assert_array_equal(can_stand(panel(), 0.03), inside)
    surface = folded(1.2)
    x = surface.vertices_m[:, 0]
    standing = can_stand(surface)
    assert not standing[np.abs(x) < 0.005].any()
    assert standing[(np.abs(x) > 0.1) & (np.abs(x) < 0.17)].any()
    assert can_stand(folded(0.1))[np.abs(x) < 0.005].any()


def test_spread_places_are_about_as_many_as_wanted_and_apart_and_those_of_a_grid_exactly():
    surface = panel()
    usable = surface.vertices_m[:, 0] > 0.0
    rows = places.spread_places(surface, usable, 100, seed=1)
    assert usable[rows].all()
    assert 80 < len(rows) < 120
    positions = surface.vertices_m[rows]
    distance = np.linalg.norm(positions[:, np.newaxis] - positions, axis=2) + np.eye(len(rows))
    assert distance.min() > 0.05
    surface = panel()
    rows = places.grid_places(surface, can_stand(surface), 25)
    assert len(set(rows)) == 25
    face = from_edges_m(surface, surface.vertices_m[rows])
    # Five rows and five columns, to the spacing of the vertices.
    for axis in range(2):
        assert np.count_nonzero(np.diff(np.sort(face[:, axis])) > 0.1) == 4
    # Places on a face are found again.
    surface = folded(0.3)
    at = np.array([[0.05, 0.1], [0.21, 0.33], [0.3, 0.02]])
    points, hit = places.on_face_m(surface, at)
    assert hit.all()
    np.testing.assert_allclose(from_edges_m(surface, points), at, atol=1e-9)
