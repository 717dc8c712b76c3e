"""A footprint that is no two Gaussians: deviations of the pattern from eq. (1).

The pattern may deviate by splines over the radius with low angular harmonics.
"""

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import eigh
from scipy.sparse import csr_array

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.readings.covariates import Rays

# Directions of the deviations below this share of the largest variance are left out.
NEGLIGIBLE = 1e-4
RADIAL_SPLINES = 9
# Correlation lengths along the radial splines: for bumps, and for changes of the whole profile.
RADIAL_LENGTHS = (1.5, 4.0)
HARMONICS = 2


def pattern_deviations_um(model: DepositionModel, rays: Rays) -> list[np.ndarray]:
    """Film (P, n) of the pattern's deviations from eq. (1), of relative size one, by kind.

    A deviation is a smooth function of the radius times a harmonic of the angle. The kinds are
    the radial profile, each harmonic of the angle, and everything together; each as bumps and as
    a change of the whole profile.
    """
    planar = model.planar
    reach = planar.r_m + 3.0 * max(planar.sigma1_m, planar.sigma2_m)
    knots = np.linspace(0.0, reach, RADIAL_SPLINES - 2)
    knots = np.concatenate([np.repeat(knots[0], 3), knots, np.repeat(knots[-1], 3)])
    radius = np.minimum(np.hypot(rays.x_m, rays.y_m), 0.999999 * reach)
    angle = np.arctan2(rays.y_m, rays.x_m)
    basis = BSpline.design_matrix(radius.ravel(), knots, 3)
    steps = np.arange(basis.shape[1])
    radial = []
    for order in range(HARMONICS + 1):
        waves = [np.cos(order * angle)] + ([np.sin(order * angle)] if order else [])
        radial.append(
            [
                np.array([np.sum(_column(basis, k, rays.share) * wave, axis=0) for k in steps]).T
                for wave in waves
            ]
        )
    kinds = []
    for length in RADIAL_LENGTHS:
        smooth = _root(_bell(steps[:, np.newaxis] - steps, length))
        orders = [np.hstack([columns @ smooth for columns in waves]) for waves in radial]
        kinds += [*orders, np.hstack(orders)]
    return kinds


def _column(basis: csr_array, k: int, share: np.ndarray) -> np.ndarray:
    return basis[:, [k]].toarray().reshape(share.shape) * share


def _bell(distance: np.ndarray, length: float) -> np.ndarray:
    return np.exp(-0.5 * (distance / length) ** 2)


def _root(covariance: np.ndarray) -> np.ndarray:
    values, vectors = eigh(covariance)
    kept = values > NEGLIGIBLE * values[-1]
    return vectors[:, kept] * np.sqrt(values[kept])
