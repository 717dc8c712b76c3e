"""Causes that are in nobody's library, and bells whose pattern is not Conner's two Gaussians.

Of the first an honest diagnosis must say 'unknown'. The second move the parcels of a Conner plume
to where the other plume has them, so that the solids are kept; no physics is missing otherwise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from .flight import Air, Landings, Slices
from .parcels import Parcels, Pattern
from .truths import Scene, Truth, between, with_drift


class MaskingTape(Truth):
    """A strip across the door, half shadowed by a lifted masking tape, takes less paint."""

    id, family, typical, unit = 'unknown:masking_tape', 'unknown', 0.25, '1'
    most = 0.95
    ranges = between(angle_rad=(0.0, np.pi), width_m=(0.06, 0.14), at=(-0.2, 0.2, 2))

    def on_landing(self, landings: Landings, scene: Scene) -> np.ndarray | float:
        if scene.part.kind != 'door':
            return 1.0
        part, a = scene.part, self.drawn['angle_rad']
        x = landings.position_m[:, 0] - self.drawn['at'][0] * part.width_m
        z = landings.position_m[:, 2] - (0.5 + self.drawn['at'][1]) * part.height_m
        off = np.abs(x * np.sin(a) - z * np.cos(a)) - 0.5 * self.drawn['width_m']
        return 1.0 - min(self.amplitude, 0.95) / (1.0 + np.exp(off / 0.006))


class ThermalStripe(Truth):
    """Hot and cold stripes of the surface ripple the film along x."""

    id, family, typical, unit = 'unknown:thermal_stripe', 'unknown', 0.06, '1'
    most = 0.4
    ranges = between(wavelength_m=(0.25, 0.50), phase_rad=(0, 2 * np.pi))

    def on_film(self, film_um, x, z, scene, film_at):
        wave = 2 * np.pi * x / self.drawn['wavelength_m'] + self.drawn['phase_rad']
        return film_um * (1.0 + self.amplitude * np.sin(wave))


class PoorGround(Truth):
    """A bolted-on patch is badly grounded and attracts less."""

    id, family, typical, unit = 'unknown:poor_ground', 'unknown', 0.12, '1'
    most = 0.9
    ranges = between(at=(0.2, 0.8, 2), radius_m=(0.12, 0.22))

    def on_landing(self, landings: Landings, scene: Scene) -> np.ndarray | float:
        if scene.part.kind != 'door':
            return 1.0
        outside = _away_m(landings, scene, self.drawn['at']) - self.drawn['radius_m']
        return 1.0 - self.amplitude / (1.0 + np.exp(outside / 0.010))


class LocalBump(Truth):
    """A dripping bell leaves a soft spot of more paint."""

    id, family, typical, unit = 'unknown:local_bump', 'unknown', 0.12, '1'
    most = 1.0
    ranges = between(at=(0.15, 0.85, 2), radius_m=(0.06, 0.16))

    def on_landing(self, landings: Landings, scene: Scene) -> np.ndarray | float:
        away = _away_m(landings, scene, self.drawn['at']) / self.drawn['radius_m']
        return 1.0 + self.amplitude * np.exp(-0.5 * away**2)


def _away_m(landings: Landings, scene: Scene, at: np.ndarray) -> np.ndarray:
    """Distance from a place given in shares of width and height."""
    x = landings.position_m[:, 0] - (at[0] - 0.5) * scene.part.width_m
    return np.hypot(x, landings.position_m[:, 2] - at[1] * scene.part.height_m)


class PumpPulsation(Truth):
    """A worn gear pump: the flow swings with a period of a few pattern radii of travel."""

    id, family, typical, unit = 'unknown:pump_pulsation', 'unknown', 0.15, '1'
    most = 0.8
    ranges = between(travel_m=(0.5, 0.9), phase_rad=(0, 2 * np.pi))

    def on_flow(self, flow: Callable, scene: Scene) -> Callable:
        nominal = scene.nominal
        speed = np.median(
            np.linalg.norm(np.diff(nominal.tcp_m, axis=0), axis=1) / np.diff(nominal.time_s)
        )
        period = self.drawn['travel_m'] / speed
        return lambda t: (
            flow(t)
            * (1.0 + self.amplitude * np.sin(2 * np.pi * t / period + self.drawn['phase_rad']))
        )


class ChargeSwirl(Truth):
    """Charge builds up on the bell and swings the plume round slowly in the tool's frame."""

    id, family, typical, unit = 'unknown:charge_swirl', 'unknown', 0.015, 'm'
    most = 0.08
    ranges = between(period_s=(4.0, 9.0), phase_rad=(0, 2 * np.pi))

    def on_air(self, air: Air, slices: Slices, parcels: Parcels) -> Air:
        angle = 2 * np.pi * slices.time_0_s / self.drawn['period_s'] + self.drawn['phase_rad']
        swing = (
            np.cos(angle)[:, None] * slices.turn_0[:, :, 0]
            + np.sin(angle)[:, None] * slices.turn_0[:, :, 1]
        )
        return with_drift(air, self.amplitude * swing)


class Elliptic(Truth):
    """Axes stretched by sqrt(1 + a) and 1 / sqrt(1 + a), at any angle."""

    id, family, typical, unit = 'footprint:elliptic', 'footprint', 0.30, '1'
    most = 1.5
    ranges = between(angle_rad=(0.0, np.pi))

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
    ranges = between(angle_rad=(-np.pi, np.pi))

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
    ranges = between(lobe_rad=(0.0, np.pi))

    def on_plume(self, parcels: Parcels, pattern: Pattern) -> Parcels:
        rho, angle = np.hypot(parcels.x_m, parcels.y_m), np.arctan2(parcels.y_m, parcels.x_m)
        moved = angle - 0.5 * self.amplitude * np.sin(2.0 * (angle - self.drawn['lobe_rad']))
        return replace(parcels, x_m=rho * np.cos(moved), y_m=rho * np.sin(moved))
