"""Eq. (1) of Conner et al. (IROS 2002) integrated along a line: a long straight pass."""

import math

import numpy as np

from paint_deposition.model.pattern import PlanarPattern

# Nodes of the line integral in the narrower standard deviation: trapezoids of a Gaussian with
# three of them are exact to 1e-15.
NODES_PER_SIGMA = 4.0


def line_integral_um_m_per_s(
    planar: PlanarPattern, across_m: np.ndarray, travel_rad: float = 0.0
) -> np.ndarray:
    """Eq. (1) integrated over a line of the model plane [um m/s].

    The part of f that is odd along the line integrates to zero. What is left of it is smooth in
    u with distance along the line = |across| sinh(u), though not in the distance itself.

    Args:
        planar: the pattern.
        across_m: (N,) signed distances of the lines from the centre, positive along
            tool z times the direction [m].
        travel_rad: direction of the lines in the tool's x-y frame [rad].
    """
    p = planar
    across = np.abs(np.atleast_1d(across_m)).astype(float)
    far = p.radius_of_flux_m(1e-14)
    step = p.sigma1_m / NODES_PER_SIGMA
    along = step * np.arange(math.ceil(far / step) + 1)
    ring = _even_sum(p.g1(across[:, np.newaxis], along), step)
    # f is strongest at right angles to phi, ahead of it.
    lopsided = p.K3 * math.cos(travel_rad - p.phi_rad)
    if lopsided:
        side = np.sign(across_m).reshape(across.shape) * lopsided
        ring = ring + side * _ring_over_radius(p, across, far)
    centre = np.exp(-0.5 * (across / p.sigma2_m) ** 2) / (p.sigma2_m * math.sqrt(2.0 * math.pi))
    film = p.K1_cm3_per_s * ((1.0 - p.K2) * ring + p.K2 * centre)
    return film.reshape(np.shape(across_m))


def _ring_over_radius(p: PlanarPattern, across: np.ndarray, far: float) -> np.ndarray:
    """|across| times the line integral of g1 over the radius; it vanishes at the centre."""
    off_centre = np.maximum(across, 1e-12 * far)
    step = p.sigma1_m / NODES_PER_SIGMA / far
    u = step * np.arange(math.ceil(math.asinh(1e12) / step) + 1)
    result = np.empty(len(across))
    for row, distance in enumerate(off_centre):
        used = u[: math.ceil(math.asinh(far / distance) / step) + 1]
        result[row] = distance * _even_sum(p.g1(distance * np.cosh(used), 0.0), step)
    return result


def _even_sum(values: np.ndarray, step: float) -> np.ndarray:
    """Trapezoids over the whole line for an even function sampled from 0 on, last axis."""
    return step * (2.0 * values.sum(axis=-1) - values[..., 0])
