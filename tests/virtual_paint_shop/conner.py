"""Eqs. (1) and (2) of Conner et al. (2002) by plain quadrature, which a clean film follows."""

from __future__ import annotations

import numpy as np
from scipy.special import erf

from .jobs import Motion
from .parcels import Pattern


def planar_flux(p: Pattern, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Eq. (1), um/s."""
    rho, s1, s2 = np.hypot(x, y), p.sigma1_m, p.sigma2_m
    inner = 2 * s1**2 * np.exp(-(p.r_m**2) / (2 * s1**2))
    outer = p.r_m * s1 * np.sqrt(2 * np.pi) * erf(p.r_m / (np.sqrt(2) * s1))
    gamma = 2 * np.pi * (inner + outer)
    ring = sum(np.exp(-((rho + side * p.r_m) ** 2) / (2 * s1**2)) for side in (-1, 1))
    g1 = ring / gamma
    g2 = np.exp(-(rho**2) / (2 * s2**2)) / (2 * np.pi * s2**2)
    f = 1 + p.K3 * np.sin(np.arctan2(y, x) - p.phi_rad)
    return p.K1_cm3_per_s * ((1 - p.K2) * f * g1 + p.K2 * g2)


def film_um(p: Pattern, motion: Motion, points_m, normals, step_s: float = 0.01) -> np.ndarray:
    """Eq. (2) summed over the time the trigger is on."""
    film = np.zeros(len(points_m))
    for on, off in motion.trigger_s.reshape(-1, 2):
        count = int(np.ceil((off - on) / step_s))
        step = (off - on) / count
        tcp, turn = motion.pose(on + (np.arange(count) + 0.5) * step)
        emission = tcp - p.emission_offset_m * turn[:, :, 2]
        for i, (point, normal) in enumerate(zip(points_m, normals, strict=True)):
            ray = point - emission
            length = np.linalg.norm(ray, axis=1)
            e = np.einsum('nji,nj->ni', turn, ray / length[:, None])
            q = p.model_plane_m * e[:, :2] / e[:, 2:]
            facing = -(ray @ normal) / length
            seen = (facing > 0) & (e[:, 2] > 0)
            flux = p.model_plane_m**2 * facing / (length**2 * e[:, 2] ** 3)
            flux = flux * planar_flux(p, q[:, 0], q[:, 1])
            film[i] += np.sum(flux[seen]) * step
    return film
