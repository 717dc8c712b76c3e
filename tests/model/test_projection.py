"""Eq. (2): paint that leaves the model plane lands on whatever stands behind it, all of it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.model.eq2_projection import NEAREST_M, Projection
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.points import SurfacePoints
from scenes import LOOKING_DOWN

PLANAR = PlanarPattern()
# Within 33 degrees of the axis to 1e-9.
NARROW = PlanarPattern(K1_cm3_per_s=1.3, K3=0.5, r_m=0.04, sigma1_m=0.025, sigma2_m=0.03)
PROJECTION = Projection(model_plane_m=0.30, emission_offset_m=0.05)
OMEGA = PROJECTION.model_plane_m
# Tool z along -z, tool x along x, tool y along -y.
DOWN = Rotation.from_quat(LOOKING_DOWN).as_matrix()
STANDOFFS_M = [0.15, 0.25, 0.4]


def flux(positions, normals, tcp, rotation=DOWN, planar=PLANAR, projection=PROJECTION):
    """What the kernel lays in a second of one pose [um/s]."""
    points = SurfacePoints(
        np.atleast_2d(np.asarray(positions, dtype=float)),
        np.atleast_2d(np.asarray(normals, dtype=float)),
    )
    film = FilmIntegrator(points, DepositionModel(planar=planar, projection=projection), 'double')
    film.add(SprayPath.of(
        np.zeros(1, np.int64), np.ones(1), np.ones(1), np.asarray(tcp, dtype=float)[np.newaxis],
        np.asarray(rotation)[np.newaxis], np.zeros((1, 3)),
    ))  # fmt: skip
    return film.raw_um


def test_on_the_model_plane_it_is_eq_1():
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, 11), np.linspace(-0.5, 0.5, 11))
    points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    got = flux(points, np.tile([0, 0, 1], (x.size, 1)), [0, 0, 0.25])
    off_axis = np.hypot(x, y).ravel() > 0
    expected = PLANAR.flux_um_per_s(x, -y).ravel()
    assert np.allclose(got[off_axis], expected[off_axis], rtol=1e-11, atol=2e-6 * expected.max())


def test_at_twice_the_distance_it_is_twice_as_wide_and_a_quarter_as_strong():
    got = flux([0.2, -0.1, 0.0], [0, 0, 1], [0, 0, 0.55])
    assert got[0] == pytest.approx(0.25 * PLANAR.flux_um_per_s(0.1, 0.05), rel=1e-11)


def test_a_slanting_element_by_hand():
    # Emission point at (0, 0, 0.4), s = (0.3, 0, 0): L = 0.5, <e, z> = 0.8, q = (0.225, 0).
    # Normal turned so that <e, n> = 0.6: Omega^2 0.6 / (0.25 * 0.512) = 0.421875.
    e = np.array([0.6, 0.0, -0.8])
    across = np.array([0.8, 0.0, 0.6])
    got = flux([0.3, 0, 0], -0.6 * e + 0.8 * across, [0, 0, 0.35])
    assert got[0] == pytest.approx(0.421875 * PLANAR.flux_um_per_s(0.225, 0.0), rel=1e-11)


def disc(radius_m, count=240, angles=180):
    """Distances t and angles over a disc with weights, smooth functions to rounding."""
    node, weight = np.polynomial.legendre.leggauss(count)
    t, weight = 0.5 * radius_m * (node + 1.0), 0.5 * radius_m * weight
    angle = 2.0 * math.pi * np.arange(angles) / angles
    t, angle = (grid.ravel() for grid in np.meshgrid(t, angle, indexing='ij'))
    return t, angle, np.repeat(weight, angles) * 2.0 * math.pi / angles


def plane(tilt_rad):
    """Disc of a plane through the origin, tilted about y."""
    t, angle, weight = disc(1.0)
    u, v = t * np.cos(angle), t * np.sin(angle)
    positions = np.stack([u * math.cos(tilt_rad), v, -u * math.sin(tilt_rad)], axis=1)
    normals = np.tile([math.sin(tilt_rad), 0.0, math.cos(tilt_rad)], (len(t), 1))
    return positions, normals, weight * t


def cylinder(radius_m):
    """Disc laid on a level cylinder along y, which bulges to the gun or, negative, is hollow."""
    t, angle, weight = disc(1.0)
    turn = t * np.cos(angle) / radius_m
    normals = np.stack([np.sin(turn), 0.0 * turn, np.cos(turn)], axis=1)
    along = np.outer(t * np.sin(angle), [0.0, 1.0, 0.0])
    return radius_m * (normals - [0.0, 0.0, 1.0]) + along, normals, weight * t


def sphere(radius_m, standoff_m):
    """Cap of a sphere as far as it is seen from the emission point."""
    seen = math.acos(radius_m / (radius_m + standoff_m + PROJECTION.emission_offset_m))
    t, angle, weight = disc(seen)
    normals = np.stack([np.sin(t) * np.cos(angle), np.sin(t) * np.sin(angle), np.cos(t)], axis=1)
    return radius_m * (normals - [0.0, 0.0, 1.0]), normals, weight * radius_m**2 * np.sin(t)


WIDE = {f'{deg} deg': plane(math.radians(deg)) for deg in (0, 15, -30, 45)}
WIDE |= {'bulging': cylinder(1.0), 'hollow': cylinder(-1.0)}


@pytest.mark.parametrize('standoff_m', STANDOFFS_M)
@pytest.mark.parametrize('surface', WIDE)
def test_a_plane_however_tilted_and_a_cylinder_wider_than_the_spray_take_all(standoff_m, surface):
    positions, normals, area = WIDE[surface]
    got = flux(positions, normals, [0, 0, standoff_m], planar=NARROW)
    assert area @ got == pytest.approx(NARROW.K1_cm3_per_s, rel=2e-5)


@pytest.mark.parametrize('standoff_m', STANDOFFS_M)
@pytest.mark.parametrize('radius_m', [0.08, 0.25, 1.0])
def test_a_sphere_takes_what_the_cone_to_its_limb_holds(standoff_m, radius_m):
    distance = radius_m + standoff_m + PROJECTION.emission_offset_m
    limb_m = OMEGA * radius_m / math.sqrt(distance**2 - radius_m**2)
    captured = PLANAR.enclosed_fraction(limb_m)
    assert 0.005 < captured < 0.99
    positions, normals, area = sphere(radius_m, standoff_m)
    got = area @ flux(positions, normals, [0, 0, standoff_m])
    assert got == pytest.approx(captured * PLANAR.K1_cm3_per_s, rel=2e-5)


@given(
    position=st.tuples(*[st.floats(-1.0, 1.0)] * 3),
    seed=st.integers(0, 1000),
    offset=st.floats(-0.2, 0.5),
    K3=st.floats(0.0, 1.0),
)
def test_no_negative_or_infinite_flux_from_anywhere(position, seed, offset, K3):
    orientation = Rotation.random(2, rng=seed)
    normal = orientation[0].apply([0.0, 0.0, 1.0])
    got = flux(
        position, normal, [0.0, 0.0, 0.0], orientation[1].as_matrix(), PlanarPattern(K3=K3),
        Projection(emission_offset_m=offset),
    )  # fmt: skip
    assert np.isfinite(got).all()
    assert got[0] >= 0.0


def test_what_looks_away_and_what_lies_behind_the_bell_gets_none():
    away = [[0, 0, -1], [0.6, 0, -0.8], [1, 0, -1e-9]]
    assert flux(np.zeros((3, 3)), away, [0, 0, 0.25]).tolist() == [0, 0, 0]
    behind = [[0.02, 0.0, 0.251], [0.0, 0.0, 0.28], [0.3, 0.0, 0.6]]
    assert flux(behind, np.tile([0, 0, 1], (3, 1)), [0, 0, 0.25]).tolist() == [0, 0, 0]
    assert flux(behind, np.tile([0, 0, -1], (3, 1)), [0, 0, 0.25]).tolist() == [0, 0, 0]
    before = flux([0.02, 0.0, 0.249], [0, 0, 1], [0, 0, 0.25])
    assert before[0] > 0.0


def test_an_emission_point_before_the_bell_has_no_pole():
    ahead = Projection(emission_offset_m=-0.1)
    assert ahead.nearest_m == NEAREST_M
    heights = 0.15 + np.array([0.1, 0.0, -1e-6, -0.9e-3, -1.1e-3])
    points = np.stack([0.0 * heights, 0.0 * heights, heights], axis=1)
    got = flux(points, np.tile([0, 0, 1], (5, 1)), [0, 0, 0.25], projection=ahead)
    assert got[:4].tolist() == [0, 0, 0, 0]
    assert got[4] > 0.0
