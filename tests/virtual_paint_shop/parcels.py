"""Paint parcels: equal shares of the sprayed solids, drawn from the plume by inverse functions.

The plume is the volcano of Conner et al. (2002), eq. (1), which is never evaluated at a surface.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

DROPLET_SIZES = 8


@dataclass(frozen=True)
class Pattern:
    """Parameters of eq. (1), and where its plane and emission point lie (metres, radians)."""

    K1_cm3_per_s: float
    K2: float
    K3: float
    phi_rad: float
    r_m: float
    sigma1_m: float
    sigma2_m: float
    model_plane_m: float = 0.30
    emission_offset_m: float = 0.05

    def scaled(self, factor: float) -> Pattern:
        """The same shape, `factor` times as wide."""
        lengths = ('r_m', 'sigma1_m', 'sigma2_m')
        return replace(self, **{name: getattr(self, name) * factor for name in lengths})


@dataclass(frozen=True)
class Parcels:
    """Parcels on the model plane. All arrays have shape (n,)."""

    x_m: np.ndarray
    y_m: np.ndarray
    mobility: np.ndarray  # how readily the air carries the droplet; mean 1
    size: np.ndarray  # 0..1, rank of the droplet's size


def conner_plume(pattern: Pattern, count: int, seed: int) -> Parcels:
    """`count` equal parcels whose density on the model plane is eq. (1).

    Kronecker points, of which any successive ones fill the square evenly -> disc (Shirley and
    Chiu) -> radius -> angle by inverses: even points stay even.
    """
    plastic, shift = 1.324717957244746, np.random.default_rng(seed).random(2)
    disc, turn = _disc(*((shift + np.arange(count)[:, None] / [plastic, plastic**2]) % 1.0).T)
    rho, ring, centred = _radial_densities(pattern)
    both = ring + centred
    mass = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(rho) * (both[1:] + both[:-1]))])
    radius = np.interp(disc**2, mass / mass[-1], rho)
    lopsided = pattern.K3 * np.interp(radius, rho, ring / np.maximum(ring + centred, 1e-300))
    angle = _lopsided_angle(turn, lopsided) + pattern.phi_rad
    size = (np.arange(count) % DROPLET_SIZES + 0.5) / DROPLET_SIZES
    return Parcels(radius * np.cos(angle), radius * np.sin(angle), mobility(size), size)


def _radial_densities(pattern: Pattern) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Radii, and mass per radius of the ring and of the centred Gaussian, each weighted."""
    sigma1, sigma2 = pattern.sigma1_m, pattern.sigma2_m
    rho = np.linspace(0.0, max(pattern.r_m + 6.5 * sigma1, 6.5 * sigma2), 6001)
    inner, outer = (np.exp(-0.5 * ((rho + r) / sigma1) ** 2) for r in (-pattern.r_m, pattern.r_m))
    ring, centred = rho * (inner + outer), rho * np.exp(-0.5 * (rho / sigma2) ** 2)
    ring = (1.0 - pattern.K2) * ring / np.trapezoid(ring, rho)
    return rho, ring, pattern.K2 * centred / np.trapezoid(centred, rho)


def _disc(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Concentric map of the unit square to the unit disc: radius, angle in 0..2 pi."""
    a, b = 2.0 * u - 1.0, 2.0 * v - 1.0
    wide = np.abs(a) > np.abs(b)
    long = np.where(wide, a, b)
    safe = np.where(long == 0.0, 1.0, long)
    angle = np.where(wide, 0.25 * np.pi * b / safe, 0.5 * np.pi - 0.25 * np.pi * a / safe)
    return np.abs(long), np.mod(angle + np.where(long < 0.0, np.pi, 0.0), 2.0 * np.pi)


def _lopsided_angle(turn: np.ndarray, k: np.ndarray) -> np.ndarray:
    """Angle t with t - k (cos t - 1) = turn: uniform turns become density 1 + k sin t."""
    t = turn.copy()
    for _ in range(6):
        t = t - (t - k * (np.cos(t) - 1.0) - turn) / (1.0 + k * np.sin(t))
    return t


def mobility(u: np.ndarray) -> np.ndarray:
    """Relative drift ~ diameter^-0.7 of log-normal droplets (30 um median, ln-width 0.4)."""
    width = 0.4 * 0.7
    z = np.clip(norm.ppf(u), -2.5, 2.5)
    carried = np.exp(-width * z)
    return carried / carried.mean()


def draw_pattern(rng, half_width: float, flow_cm3_per_s: float) -> Pattern:
    """A believable bell pattern with the given SB50 (metres).

    SB50: full width at half the height of the pattern collapsed along the travel direction.
    """
    ranges = ((0.05, 0.35), (0.0, 0.3), (-np.pi, np.pi), (0.28, 0.40), (0.13, 0.20), (0.20, 0.30))
    shape = (rng.uniform(*limits) for limits in ranges)
    start = Pattern(flow_cm3_per_s, *shape).scaled(half_width)
    edges = np.linspace(-0.9, 0.9, 361)
    profile, _ = np.histogram(conner_plume(start, 1 << 15, seed=1).y_m, edges)
    smooth = np.convolve(profile, np.hanning(9) / np.hanning(9).sum(), mode='same')
    above = np.flatnonzero(smooth >= 0.5 * smooth.max())
    return start.scaled(half_width / float(edges[above[-1] + 1] - edges[above[0]]))
