"""Parts split into faces that can be sprayed from one side each."""

import numpy as np
import pytest

from booth import panel
from folded_parts import bumper, hood
from paint_deposition.planning.sides import sprayable_faces


def outward(face) -> np.ndarray:
    mean = face.surface.vertex_areas_m2 @ face.surface.normals
    return mean / np.linalg.norm(mean)


def test_a_plane_is_one_face_a_hood_two_and_a_bumper_three():
    (face,) = sprayable_faces(panel())
    assert face.surface.area_m2 == pytest.approx(panel().area_m2)
    assert np.isinf(face.seam_distance_m).all()
    assert face.without_margin(0.1) is face
    top, flange = sprayable_faces(hood())
    assert outward(top)[2] > 0.99
    assert outward(flange)[1] > 0.95
    assert top.surface.area_m2 + flange.surface.area_m2 == pytest.approx(hood().area_m2)
    assert flange.surface.area_m2 == pytest.approx(1.0 * (0.18 + 0.04), rel=0.15)
    # The wings look the same way where it is bent into a U; they do not hang together.
    front, *wings = sprayable_faces(bumper())
    assert outward(front)[1] == pytest.approx(-1.0, abs=1e-3)
    assert sorted(round(outward(wing)[0], 1) for wing in wings) == [-1.0, 1.0]
    assert len(sprayable_faces(bumper(wing_m=0.3), np.radians(60.0))) == 3


def test_a_margin_is_taken_from_the_seam_alone():
    front, *_ = sprayable_faces(bumper())
    seam = np.abs(front.surface.vertices_m[:, 0]).max()
    less = front.without_margin(0.1)
    assert seam - np.abs(less.surface.vertices_m[:, 0]).max() == pytest.approx(0.1, abs=0.05)
    assert np.ptp(less.surface.vertices_m[:, 2]) == pytest.approx(0.4)
    # However great the margin, the middle of the face is left.
    assert front.without_margin(5.0).surface.area_m2 > 0.1 * front.surface.area_m2
    assert front.without_margin(0.0) is front
