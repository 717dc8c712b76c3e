"""The film against eqs. (1) and (2) in fifty digits, at random poses of random guns."""

import mpmath
import numpy as np
import pytest
from mpmath import mp, mpf
from scipy.spatial.transform import Rotation

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.model.eq2_projection import Projection
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.points import SurfacePoints
from scenes import painted

POSES, POINTS = 25, 40
# Of the peak: what double arithmetic must keep, and what single promises.
DOUBLE, SINGLE = 2e-12, 1e-6


def flux_um_per_s(model, position, normal, tcp, rotation):
    """Eq. (2) of one point for one pose, by the paper; all numbers of fifty digits."""
    plane, pattern = mpf(model.projection.model_plane_m), model.planar
    axes = [[mpf(value) for value in column] for column in rotation.T.tolist()]
    behind = mpf(model.projection.emission_offset_m)
    emission = [mpf(at) - behind * axis for at, axis in zip(tcp.tolist(), axes[2], strict=True)]
    ray = [mpf(place) - start for place, start in zip(position.tolist(), emission, strict=True)]
    x, y, z = (mpmath.fdot(ray, axis) for axis in axes)
    length = mpmath.sqrt(mpmath.fdot(ray, ray))
    incidence = -mpmath.fdot(ray, [mpf(value) for value in normal.tolist()]) / length
    if z <= model.projection.nearest_m or incidence <= 0:
        return mpf(0)
    planar = _planar(pattern, plane * x / z, plane * y / z)
    return planar * (plane / length) ** 2 * incidence / (z / length) ** 3


def _planar(pattern, x, y):
    """Eq. (1): a ring, heavier to one side, and a Gaussian at its centre."""
    k1, k2, k3 = (mpf(getattr(pattern, name)) for name in ('K1_cm3_per_s', 'K2', 'K3'))
    r, s1, s2 = (mpf(getattr(pattern, name)) for name in ('r_m', 'sigma1_m', 'sigma2_m'))
    rho = mpmath.sqrt(x * x + y * y)
    f = 1 + k3 * mpmath.sin(mpmath.atan2(y, x) - mpf(pattern.phi_rad))

    def ring(at):
        outer = mpmath.exp(-((at - r) ** 2) / (2 * s1**2))
        return outer + mpmath.exp(-((at + r) ** 2) / (2 * s1**2))

    # The volume under the ring is one: its integral over the plane, in closed form.
    gamma = 4 * mp.pi * (
        s1**2 * mpmath.exp(-(r**2) / (2 * s1**2))
        + r * s1 * mpmath.sqrt(mp.pi / 2) * mpmath.erf(r / (mpmath.sqrt(2) * s1))
    )  # fmt: skip
    g2 = mpmath.exp(-(rho**2) / (2 * s2**2)) / (2 * mp.pi * s2**2)
    return k1 * ((1 - k2) * f * ring(rho) / gamma + k2 * g2)


@pytest.fixture(scope='module')
def worlds():
    """Random guns over random points: (model, points, path, film in fifty digits)."""
    rng = np.random.default_rng(11)
    made = []
    with mpmath.workdps(50):
        for _ in range(4):
            planar = PlanarPattern(
                K1_cm3_per_s=rng.uniform(0.5, 4.0), K2=rng.uniform(0, 1), K3=rng.uniform(0, 1),
                phi_rad=rng.uniform(-3, 3), r_m=rng.uniform(0.02, 0.25),
                sigma1_m=rng.uniform(0.02, 0.1), sigma2_m=rng.uniform(0.02, 0.15),
            )  # fmt: skip
            plane_m, offset_m = rng.uniform(0.15, 0.5), rng.uniform(0.0, 0.1)
            projection = Projection(model_plane_m=plane_m, emission_offset_m=offset_m)
            model = DepositionModel(planar=planar, projection=projection)
            normals = rng.normal([0.0, 0.0, 2.0], 1.0, size=(POINTS, 3))
            normals /= np.linalg.norm(normals, axis=1, keepdims=True)
            places = rng.uniform([-0.4, -0.4, -0.1], [0.4, 0.4, 0.1], size=(POINTS, 3))
            points = SurfacePoints(places, normals, area_m2=np.ones(POINTS), down=(0.0, 0.0, -1.0))
            path = _random_path(rng)
            film = [
                mpmath.fsum(
                    mpf(path.dwell_s[k]) * mpf(path.flow[k])
                    * flux_um_per_s(model, place, normal, path.position_m[k], path.rotation[k])
                    for k in range(POSES)
                )
                for place, normal in zip(places, normals, strict=True)
            ]  # fmt: skip
            made.append((model, points, path, film))
    return made


def _random_path(rng) -> SprayPath:
    tilt = Rotation.from_rotvec(rng.normal(scale=0.5, size=(POSES, 3)))
    rotation = (Rotation.from_quat([1.0, 0.0, 0.0, 0.0]) * tilt).as_matrix()
    return SprayPath.of(
        np.arange(POSES), rng.uniform(0.001, 0.02, POSES), rng.uniform(0.5, 1.5, POSES),
        rng.uniform([-0.4, -0.4, 0.15], [0.4, 0.4, 0.4], size=(POSES, 3)), rotation,
        np.zeros((POSES, 3)),
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(('precision', 'tolerance'), [('double', DOUBLE), ('single', SINGLE)])
def test_the_film_is_right_to_its_last_digits(worlds, precision, tolerance):
    for model, points, path, film in worlds:
        film_um = painted(points, path, model, precision).film_um
        largest = max(film)
        assert largest > 0.01
        with mpmath.workdps(50):
            both = zip(film_um.tolist(), film, strict=True)
            assert max(abs(mpf(ours) - exact) for ours, exact in both) < tolerance * largest
