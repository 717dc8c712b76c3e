"""Plans for parts with several sides: the faces, their order, and the film."""

import numpy as np
import pytest

import paint_deposition as pd
from booth import panel
from folded_parts import bumper, hood
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.planning.faces import join_motions, order_faces, plan_faces
from paint_deposition.planning.passes import PassStyle, PlannedPass
from paint_deposition.planning.planned_film import contacts
from paint_deposition.planning.requests import PlanRequest
from paint_deposition.planning.sides import sprayable_faces
from scenes import painted
from surfaces import solid

NARROW = pd.DepositionModel(
    planar=PlanarPattern(K1_cm3_per_s=1.0, K3=0.0, r_m=0.1, sigma1_m=0.042, sigma2_m=0.07)
)


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


def level_pass(y_m: float, begin_m=0.0, end_m=1.0, one_way: bool = False) -> PlannedPass:
    """A straight pass along x."""
    places = np.array([[begin_m, y_m, 0.2], [end_m, y_m, 0.2]])
    turns = np.tile(np.diag([1.0, -1.0, -1.0]), (2, 1, 1))
    style = PassStyle(standoff_m=0.2, speed_m_per_s=0.3, one_way=one_way)
    return PlannedPass(y_m, places, turns, np.array([0.0, 1.0]), 0.1, 0.8, 0.3, style)


@pytest.mark.slow
def test_faces_paint_the_whole_part_more_evenly_when_blended_and_keep_clear():
    planned = plan_faces(bumper(), NARROW, PlanRequest(target_um=20.0), 'part')
    assert planned.statistics.coverage == 1.0
    assert planned.sigma_n < 0.6 * planned.sigma_n_unblended
    assert planned.statistics.mean_um == pytest.approx(20.0, rel=0.02)
    simulated = painted(planned.surface.points(), planned.trajectory, NARROW)
    np.testing.assert_allclose(planned.film_um, simulated.film_um, rtol=1e-4)
    motion = planned.trajectory
    step = np.linalg.norm(np.diff(motion.positions_m, axis=0), axis=1)
    assert np.all(step <= 1.3 * 1e-9 * np.diff(motion.stamps_ns))
    assert planned.contacts == contacts(planned.surface, motion, planned.envelope) == ()


@pytest.mark.slow
def test_the_back_of_a_closed_part_stays_bare():
    sheet = hood(0.08)
    surface = pd.Surface.from_triangles(*solid(sheet.vertices_m, sheet.faces, 0.002), 1.0)
    found = plan_faces(surface, NARROW, PlanRequest(target_um=20.0, outward=(0.0, 0.0, 1.0)))
    assert len(found.faces) == 2
    assert found.statistics.area_m2 == pytest.approx(sheet.area_m2, rel=0.05)


def test_faces_follow_each_other_with_least_travel():
    """Two faces end to end: the second is run the other way round."""

    def faces_of(one_way: bool) -> list:
        ends = ((0.0, 0.3), (0.9, 0.6))
        way = {'one_way': one_way}
        return [(level_pass(y, **way), level_pass(z, 1.0, 0.0, **way)) for y, z in ends]

    faces, fixed = faces_of(False), faces_of(True)
    one, other = order_faces(faces[::-1])
    assert np.linalg.norm(other[0].positions_m[0] - one[-1].positions_m[-1]) == pytest.approx(0.3)
    assert {face[0].across_m for face in order_faces(fixed[::-1])} == {0.0, 0.9}


def test_between_faces_the_gun_is_drawn_back_until_it_is_clear():
    faces = [(level_pass(y),) for y in (0.0, 1.0)]
    heights_m = []

    def clear_at_the_third(way) -> bool:
        heights_m.append(way.positions_m[:, 2].max())
        return len(heights_m) == 3

    motion, _ = join_motions(faces, 'part', clear_at_the_third)
    np.testing.assert_allclose(heights_m, [0.3, 0.4, 0.6])
    assert motion.positions_m[:, 2].max() == pytest.approx(0.6)
    seconds = 1e-9 * motion.trigger_stamps_ns
    assert np.all(np.diff(seconds) > 0.0)
    assert motion.trigger_flow.tolist() == [1.0, 0.0, 1.0, 0.0]
