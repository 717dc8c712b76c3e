"""Drops of five sizes in an air jet, and the bell that they leave.

Air leaves the bell as a jet whose streamlines are straight rays; drops of each size enter it on a
ring of their own and follow it, so that without further physics the pattern grows as a cone.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache

import numpy as np

REFERENCE_M = 0.30  # distance at which patterns are given
# Drops: diameter, share of the volume, and what follows for paint of 1000 kg/m3 in air.
DIAMETER_M = 1e-6 * np.array([12.0, 20.0, 30.0, 42.0, 60.0])
SHARE = np.array([0.08, 0.2, 0.32, 0.27, 0.13])
RELAX_S = 1000.0 * DIAMETER_M**2 / (18.0 * 1.8e-5)
SIZES = range(len(SHARE))
JET_M_PER_S, CORE_M = 25.0, 0.06  # the jet's axis: 25 m/s up to 60 mm, then as 1 / distance
HEIGHTS_M = np.linspace(0.12, 0.52, 9)
TIME_STEPS = 400


def air_m_per_s(distance_m: np.ndarray) -> np.ndarray:
    """Speed of the air on the jet's axis."""
    return JET_M_PER_S / np.maximum(distance_m / CORE_M, 1.0)


@cache
def flights() -> tuple[np.ndarray, np.ndarray]:
    """(sizes, heights) time of flight [s] and lag [s] of a cross-wind's hold on the drops.

    A drop in a cross-wind w lands w x lag aside: it takes up the wind only as it relaxes, and
    meets the wind in full only where the jet has slowed down.
    """
    time, aside = (np.zeros((len(RELAX_S), len(HEIGHTS_M))) for _ in range(2))
    for k, relax in enumerate(RELAX_S):
        # Speed, place, sidewise speed and shift in a wind of 1 m/s, by exponential steps.
        distance, speed, cross, shift, clock = 0.01, JET_M_PER_S, 0.0, 0.0, 0.0
        step = 1.2 * HEIGHTS_M[-1] / TIME_STEPS
        steps = [(0.0, 0.0, 0.0)]
        while distance <= HEIGHTS_M[-1]:
            now = step / speed
            hold = np.exp(-now / relax)
            air = air_m_per_s(distance)
            speed = air + (speed - air) * hold
            wind = 1.0 / (1.0 + air / 4.0)
            cross = wind + (cross - wind) * hold
            distance, clock, shift = distance + step, clock + now, shift + cross * now
            steps.append((distance, clock, shift))
        ways, clocks, shifts = zip(*steps, strict=True)
        time[k] = np.interp(HEIGHTS_M, ways, clocks)
        aside[k] = np.interp(HEIGHTS_M, ways, shifts)
    return time, aside


def arriving(depth_m: np.ndarray, light: float) -> np.ndarray:
    """(sizes, ...) share of the drops that leave the air which turns aside before the wall.

    By their Stokes number in a stagnating jet; `light` sets how much of it is missed, and at the
    reference distance the whole pattern is what it is given as.
    """

    def caught(depth_m):
        stokes = RELAX_S.reshape(-1, *(1,) * np.ndim(depth_m)) * air_m_per_s(depth_m)
        stokes = stokes / (light * 0.05)
        return stokes**2 / (stokes + 0.25) ** 2

    return caught(depth_m) / np.tensordot(SHARE, caught(np.asarray(REFERENCE_M)), (0, 0))


def drawn_in(depth_m: np.ndarray, entrained: float) -> np.ndarray:
    """How far out a ray has got at a distance over a straight one, 1 at the reference distance.

    Air that the jet draws in carries drops toward the axis, most while the jet is thin: the ray
    obeys dr/dx = r/x - e r / (x + 50 mm).
    """
    return ((depth_m + 0.05) / (REFERENCE_M + 0.05)) ** -entrained


@dataclass(frozen=True)
class Bell:
    """Rings on which drops of each size cross the reference plane."""

    flow_cm3_per_s: float
    ring_m: np.ndarray  # (sizes,) radius
    soft_m: np.ndarray  # (sizes,) spread
    lobes: tuple[float, int, float] = (0.0, 1, 0.0)  # size, number, angle
    squeeze: float = 0.0
    centre_m: tuple[float, float] = (0.0, 0.0)
    free: np.ndarray = field(default_factory=lambda: np.zeros(9))

    # Standard deviations of what a judge takes as free in a bell.
    FREE = np.array([0.5, 0.25, 0.25, 0.2, 0.2, 0.3, 0.3, 0.15, 0.15])

    def density(self, u: np.ndarray, v: np.ndarray, sizes=SIZES) -> np.ndarray:
        """(sizes, ...) share of the flow a square metre of the reference plane."""
        level, wide, soft, heavy, light, lean_u, lean_v, squeeze, turned = self.free
        stretch = np.exp(0.5 * (self.squeeze + squeeze))
        u, v = (u - self.centre_m[0]) / stretch, (v - self.centre_m[1]) * stretch
        u = u + turned * v
        reach, around = np.hypot(u, v), np.arctan2(v, u)
        size, number, at = self.lobes
        uneven = 1.0 + size * np.cos(number * (around - at))
        uneven = uneven + (lean_u * u + lean_v * v) / (reach + 1e-3 + self.ring_m[2])
        weights = np.exp(level) * (1 + heavy * np.linspace(-1, 1, 5) + light * np.cos(
            np.linspace(0, np.pi, 5) * 2))  # fmt: skip
        rings, widths = self.ring_m * np.exp(wide), self.soft_m * np.exp(soft)
        found = [
            weights[k] * _ring(reach, rings[k], widths[k]) * uneven
            / _ring_area(rings[k], widths[k]) for k in sizes
        ]  # fmt: skip
        return np.maximum(np.stack(found), 0.0)

    @property
    def track_m(self) -> float:
        """Paint of a pass over its peak: the width of a box."""
        line = np.linspace(-0.6, 0.6, 241)
        table = np.tensordot(SHARE, self.density(*np.meshgrid(line, line)), 1)
        return float(1.0 / (table.sum(axis=0).max() * (line[1] - line[0])))


def _ring(reach: np.ndarray, ring: float, width: float) -> np.ndarray:
    """A ring drawn soft."""
    edge = np.exp(-0.5 * ((reach - ring) / width) ** 2)
    return edge + np.exp(-0.5 * ((reach + ring) / width) ** 2)


def _ring_area(ring: float, width: float) -> float:
    reach = np.linspace(0.0, ring + 6 * width, 400)
    return float(2 * np.pi * np.trapezoid(_ring(reach, ring, width) * reach, reach))
