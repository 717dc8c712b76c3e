"""Causes that are in nobody's library, and bells whose pattern is not Conner's two Gaussians.

Of the first a diagnosis must say unknown; the second move parcels, so that the solids are kept.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .flight import Landings
from .truths import Scene, Truth, between, with_drift


class MaskingTape(Truth):
    """A strip across the door, half shadowed by a lifted masking tape, takes less paint."""

    id, family, typical, most, unit = 'unknown:masking_tape', 'unknown', 0.25, 0.95, '1'
    ranges = between(angle_rad=(0.0, np.pi), width_m=(0.06, 0.14), at=(-0.2, 0.2, 2))

    def on_landing(self, landings, scene):
        if scene.part.kind != 'door':
            return 1.0
        part, a = scene.part, self.drawn['angle_rad']
        x = landings.position_m[:, 0] - self.drawn['at'][0] * part.width_m
        z = landings.position_m[:, 2] - (0.5 + self.drawn['at'][1]) * part.height_m
        off = np.abs(x * np.sin(a) - z * np.cos(a)) - 0.5 * self.drawn['width_m']
        return 1.0 - min(self.amplitude, 0.95) / (1.0 + np.exp(off / 0.006))


class ThermalStripe(Truth):
    """Hot and cold stripes of the surface ripple the film along x."""

    id, family, typical, most, unit = 'unknown:thermal_stripe', 'unknown', 0.06, 0.4, '1'
    ranges = between(wavelength_m=(0.25, 0.50), phase_rad=(0, 2 * np.pi))

    def on_film(self, film_um, x, z, scene, film_at):
        wave = 2 * np.pi * x / self.drawn['wavelength_m'] + self.drawn['phase_rad']
        return film_um * (1.0 + self.amplitude * np.sin(wave))


class PoorGround(Truth):
    """A bolted-on patch is badly grounded and attracts less."""

    id, family, typical, most, unit = 'unknown:poor_ground', 'unknown', 0.12, 0.9, '1'
    ranges = between(at=(0.2, 0.8, 2), radius_m=(0.12, 0.22))

    def on_landing(self, landings, scene):
        if scene.part.kind != 'door':
            return 1.0
        outside = _away_m(landings, scene, self.drawn['at']) - self.drawn['radius_m']
        return 1.0 - self.amplitude / (1.0 + np.exp(outside / 0.010))


class LocalBump(Truth):
    """A dripping bell leaves a soft spot of more paint."""

    id, family, typical, most, unit = 'unknown:local_bump', 'unknown', 0.12, 1.0, '1'
    ranges = between(at=(0.15, 0.85, 2), radius_m=(0.06, 0.16))

    def on_landing(self, landings, scene):
        away = _away_m(landings, scene, self.drawn['at']) / self.drawn['radius_m']
        return 1.0 + self.amplitude * np.exp(-0.5 * away**2)


def _away_m(landings: Landings, scene: Scene, at: np.ndarray) -> np.ndarray:
    """Distance from a place given in shares of width and height."""
    x = landings.position_m[:, 0] - (at[0] - 0.5) * scene.part.width_m
    return np.hypot(x, landings.position_m[:, 2] - at[1] * scene.part.height_m)


class PumpPulsation(Truth):
    """A worn gear pump: the flow swings with a period of a few pattern radii of travel."""

    id, family, typical, most, unit = 'unknown:pump_pulsation', 'unknown', 0.15, 0.8, '1'
    ranges = between(travel_m=(0.5, 0.9), phase_rad=(0, 2 * np.pi))

    def on_flow(self, flow, scene):
        way_m = np.linalg.norm(np.diff(scene.nominal.tcp_m, axis=0), axis=1)
        period = self.drawn['travel_m'] / np.median(way_m / np.diff(scene.nominal.time_s))
        phase = self.drawn['phase_rad']
        return lambda t: flow(t) * (1.0 + self.amplitude * np.sin(2 * np.pi * t / period + phase))


class ChargeSwirl(Truth):
    """Charge builds up on the bell and swings the plume round slowly in the tool's frame."""

    id, family, typical, most, unit = 'unknown:charge_swirl', 'unknown', 0.015, 0.08, 'm'
    ranges = between(period_s=(4.0, 9.0), phase_rad=(0, 2 * np.pi))

    def on_air(self, air, slices, parcels):
        angle = 2 * np.pi * slices.time_0_s / self.drawn['period_s'] + self.drawn['phase_rad']
        x, y = slices.turn_0[:, :, 0], slices.turn_0[:, :, 1]
        swing = np.cos(angle)[:, None] * x + np.sin(angle)[:, None] * y
        return with_drift(air, self.amplitude * swing)


def _turned(x: np.ndarray, y: np.ndarray, angle_rad: float) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates along axes that are turned by an angle."""
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    return x * cos + y * sin, -x * sin + y * cos


class Elliptic(Truth):
    """Axes stretched by sqrt(1 + a) and 1 / sqrt(1 + a), at any angle."""

    id, family, typical, most, unit = 'footprint:elliptic', 'footprint', 0.30, 1.5, '1'
    ranges = between(angle_rad=(0.0, np.pi))

    def on_plume(self, parcels, pattern):
        a, stretch = self.drawn['angle_rad'], np.sqrt(1.0 + self.amplitude)
        u, v = _turned(parcels.x_m, parcels.y_m, a)
        x, y = _turned(u * stretch, v / stretch, -a)
        return replace(parcels, x_m=x, y_m=y)


class TriangularRing(Truth):
    """Radii follow a triangle (0, peak, end) instead; a = 1 entirely, less: part of the way."""

    id, family, typical, most, unit = 'footprint:triangular_ring', 'footprint', 0.6, 1.0, '1'

    def on_plume(self, parcels, pattern):
        rho = np.hypot(parcels.x_m, parcels.y_m)
        rank = np.empty(rho.size)
        rank[np.argsort(rho)] = (np.arange(rho.size) + 0.5) / rho.size
        end = pattern.r_m + 2.2 * pattern.sigma1_m
        bend = pattern.r_m / end
        falling = 1.0 - np.sqrt((1.0 - rank) * (1.0 - bend))
        triangle = np.where(rank < bend, np.sqrt(rank * bend), falling) * end
        share = min(self.amplitude, 1.0)
        scale = ((1.0 - share) * rho + share * triangle) / np.maximum(rho, 1e-9)
        return replace(parcels, x_m=parcels.x_m * scale, y_m=parcels.y_m * scale)


class Skewed(Truth):
    """A banana: parcels are pushed sideways by a x^2 / r."""

    id, family, typical, most, unit = 'footprint:skewed', 'footprint', 0.25, 1.2, '1'
    ranges = between(angle_rad=(-np.pi, np.pi))

    def on_plume(self, parcels, pattern):
        a = self.drawn['angle_rad']
        bend = _turned(parcels.x_m, parcels.y_m, a)[0] ** 2 / pattern.r_m
        push = self.amplitude * (bend - bend.mean())
        x, y = parcels.x_m - push * np.sin(a), parcels.y_m + push * np.cos(a)
        return replace(parcels, x_m=x, y_m=y)


class TwoLobes(Truth):
    """The ring has two lobes: angular density about 1 + a cos 2(angle - lobe)."""

    id, family, typical, most, unit = 'footprint:two_lobes', 'footprint', 0.30, 0.9, '1'
    ranges = between(lobe_rad=(0.0, np.pi))

    def on_plume(self, parcels, pattern):
        rho, angle = np.hypot(parcels.x_m, parcels.y_m), np.arctan2(parcels.y_m, parcels.x_m)
        moved = angle - 0.5 * self.amplitude * np.sin(2.0 * (angle - self.drawn['lobe_rad']))
        return replace(parcels, x_m=rho * np.cos(moved), y_m=rho * np.sin(moved))
