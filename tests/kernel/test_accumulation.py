"""The compiled loop against eqs. (1) and (2) in NumPy."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.integrator import FEW_RAYS
from paint_deposition.kernel import blocks
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.model.eq2_projection import Projection
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.part.points import SurfacePoints
from patterns import PATTERNS
from reference import reference_film_um
from scenes import LOOKING_DOWN, lying_plane, painted, straight_pass, weaving

PROJECTIONS = {
    'default': Projection(),
    'at the bell': Projection(emission_offset_m=0.0),
    'before the bell': Projection(emission_offset_m=-0.04, model_plane_m=0.2),
    'far behind': Projection(emission_offset_m=0.4, model_plane_m=0.7),
}
# Of the peak. Single precision: a coordinate's last bit against a ring of 10 mm; double: what lies
# beyond the reach, which is left out.
TOLERANCE = {'single': 5e-6, 'double': 1e-7}


def rough_surface(seed=3, count=900):
    """Points scattered about a plane that look anywhere, mostly up."""
    rng = np.random.default_rng(seed)
    positions = rng.uniform(-1.0, 1.0, (count, 3)) * [0.7, 0.7, 0.08]
    normals = Rotation.from_rotvec(rng.normal(0.0, 0.6, (count, 3))).apply([0.0, 0.0, 1.0])
    return SurfacePoints(positions, normals)


@pytest.mark.parametrize('projection', PROJECTIONS.values(), ids=PROJECTIONS)
@pytest.mark.parametrize('planar', PATTERNS.values(), ids=PATTERNS)
def test_it_computes_eqs_1_and_2_what_one_sub_step_reaches_to_rounding(planar, projection):
    model = DepositionModel(planar=planar, projection=projection)
    points = rough_surface()
    path, _ = spray_path(weaving(np.arange(0.0, 3.0, 0.05)))
    expected = reference_film_um(points, path, model)
    assert np.count_nonzero(expected) > 100
    for precision, tolerance in TOLERANCE.items():
        error = np.abs(painted(points, path, model, precision).raw_um - expected)
        assert error.max() <= tolerance * expected.max()
    one = path.select(slice(40, 41))
    expected = reference_film_um(points, one, model)
    film = painted(points, one, model, 'double').raw_um
    reached = film > 0.0
    assert np.count_nonzero(reached) > 100
    assert np.abs(film - expected)[reached].max() <= 1e-13 * expected.max()


@pytest.mark.parametrize('seed', range(4))
def test_the_film_of_random_guns_is_right_to_its_last_digits(seed):
    """So few points that none is out of reach: what double must keep, and what single promises."""
    rng, poses = np.random.default_rng(seed), 25
    planar = PlanarPattern(
        K1_cm3_per_s=rng.uniform(0.5, 4.0), K2=rng.uniform(0, 1), K3=rng.uniform(0, 1),
        phi_rad=rng.uniform(-3, 3), r_m=rng.uniform(0.02, 0.25),
        sigma1_m=rng.uniform(0.02, 0.1), sigma2_m=rng.uniform(0.02, 0.15),
    )  # fmt: skip
    plane_m, offset_m = rng.uniform(0.15, 0.5), rng.uniform(0.0, 0.1)
    projection = Projection(model_plane_m=plane_m, emission_offset_m=offset_m)
    model = DepositionModel(planar=planar, projection=projection)
    tilt = Rotation.from_rotvec(rng.normal(scale=0.5, size=(poses, 3)))
    path = SprayPath.of(
        np.arange(poses), rng.uniform(0.001, 0.02, poses), rng.uniform(0.5, 1.5, poses),
        rng.uniform([-0.4, -0.4, 0.15], [0.4, 0.4, 0.4], size=(poses, 3)),
        (Rotation.from_quat(LOOKING_DOWN) * tilt).as_matrix(), np.zeros((poses, 3)),
    )  # fmt: skip
    points = rough_surface(seed, 40)
    expected = reference_film_um(points, path, model)
    assert expected.max() > 0.01
    for precision, tolerance in (('double', 2e-12), ('single', 1e-6)):
        error = np.abs(painted(points, path, model, precision).raw_um - expected)
        assert error.max() < tolerance * expected.max()


def test_the_pattern_shift_moves_the_pattern_over_the_model_plane():
    path, _ = spray_path(straight_pass(np.linspace(0, 1, 51)))
    shift = np.array([0.03, -0.05])
    shifted = path.with_(pattern_shift_m=np.tile(shift, (len(path), 1)))
    # On the model plane a shift by (x, y) in tool axes is a move of the gun by (x, -y).
    moved = path.with_(position_m=path.position_m + np.array([0.03, 0.05, 0.0]))
    one, other = (painted(lying_plane(), each).raw_um for each in (shifted, moved))
    assert np.allclose(one, other, rtol=0, atol=2e-6 * other.max())


@pytest.mark.slow
@pytest.mark.parametrize('precision', ['single', 'double'])
def test_what_is_left_out_of_reach_is_nothing(precision):
    """A small pattern on a large plane: most blocks are skipped most of the time."""
    model = DepositionModel(
        planar=PlanarPattern(r_m=0.05, sigma1_m=0.02, sigma2_m=0.03),
        projection=Projection(model_plane_m=0.3),
    )
    points = lying_plane(0.7, 201)
    path, _ = spray_path(straight_pass(np.linspace(0, 4, 41), (-0.4, -0.2, 0.25), (0.4, 0.3, 0.3)))
    expected = reference_film_um(points, path, model)
    error = np.abs(painted(points, path, model, precision).raw_um - expected)
    assert error.max() < 1e-6 * expected.max()


def test_the_number_of_threads_changes_no_bit(monkeypatch):
    path, _ = spray_path(weaving(np.arange(0.0, 2.0, 0.02)))
    points = lying_plane(count=80)
    assert len(points) * len(path) > FEW_RAYS  # fewer are painted by one thread
    films = []
    for count in (1, 2, 3):
        monkeypatch.setattr(blocks, 'THREADS', count)
        films.append(painted(points, path).raw_um)
    assert films[0].max() > 1.0
    assert np.array_equal(films[0], films[1])
    assert np.array_equal(films[0], films[2])
