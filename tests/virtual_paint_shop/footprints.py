"""Bells whose pattern is not Conner's two Gaussians; no physics is missing otherwise.

Each moves the parcels of a Conner plume to where the other plume has them, so the solids are kept.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .parcels import Parcels, Pattern
from .truths import Truth


class Elliptic(Truth):
    """Axes stretched by sqrt(1 + a) and 1 / sqrt(1 + a), at any angle."""

    id, family, typical, unit = 'footprint:elliptic', 'footprint', 0.30, '1'
    most = 1.5

    @classmethod
    def details(cls, rng):
        return {'angle_rad': rng.uniform(0.0, np.pi)}

    def on_plume(self, parcels: Parcels, pattern: Pattern) -> Parcels:
        a, stretch = self.drawn['angle_rad'], np.sqrt(1.0 + self.amplitude)
        u = (parcels.x_m * np.cos(a) + parcels.y_m * np.sin(a)) * stretch
        v = (-parcels.x_m * np.sin(a) + parcels.y_m * np.cos(a)) / stretch
        return replace(
            parcels, x_m=u * np.cos(a) - v * np.sin(a), y_m=u * np.sin(a) + v * np.cos(a)
        )


class TriangularRing(Truth):
    """Radii follow a triangle (0, peak, end) instead; a = 1 entirely, less: part of the way."""

    id, family, typical, unit = 'footprint:triangular_ring', 'footprint', 0.6, '1'
    most = 1.0

    def on_plume(self, parcels: Parcels, pattern: Pattern) -> Parcels:
        rho = np.hypot(parcels.x_m, parcels.y_m)
        rank = np.empty(rho.size)
        rank[np.argsort(rho)] = (np.arange(rho.size) + 0.5) / rho.size
        peak = pattern.r_m
        end = pattern.r_m + 2.2 * pattern.sigma1_m
        bend = peak / end
        triangle = (
            np.where(rank < bend, np.sqrt(rank * bend), 1.0 - np.sqrt((1.0 - rank) * (1.0 - bend)))
            * end
        )
        share = min(self.amplitude, 1.0)
        scale = ((1.0 - share) * rho + share * triangle) / np.maximum(rho, 1e-9)
        return replace(parcels, x_m=parcels.x_m * scale, y_m=parcels.y_m * scale)


class Skewed(Truth):
    """A banana: parcels are pushed sideways by a x^2 / r."""

    id, family, typical, unit = 'footprint:skewed', 'footprint', 0.25, '1'
    most = 1.2

    @classmethod
    def details(cls, rng):
        return {'angle_rad': rng.uniform(-np.pi, np.pi)}

    def on_plume(self, parcels: Parcels, pattern: Pattern) -> Parcels:
        a = self.drawn['angle_rad']
        u = parcels.x_m * np.cos(a) + parcels.y_m * np.sin(a)
        bend = u**2 / pattern.r_m
        push = self.amplitude * (bend - bend.mean())
        return replace(
            parcels, x_m=parcels.x_m - push * np.sin(a), y_m=parcels.y_m + push * np.cos(a)
        )


class TwoLobes(Truth):
    """The ring has two lobes: angular density about 1 + a cos 2(angle - lobe)."""

    id, family, typical, unit = 'footprint:two_lobes', 'footprint', 0.30, '1'
    most = 0.9

    @classmethod
    def details(cls, rng):
        return {'lobe_rad': rng.uniform(0.0, np.pi)}

    def on_plume(self, parcels: Parcels, pattern: Pattern) -> Parcels:
        rho, angle = np.hypot(parcels.x_m, parcels.y_m), np.arctan2(parcels.y_m, parcels.x_m)
        moved = angle - 0.5 * self.amplitude * np.sin(2.0 * (angle - self.drawn['lobe_rad']))
        return replace(parcels, x_m=rho * np.cos(moved), y_m=rho * np.sin(moved))
