"""Causes that are in nobody's library: an honest diagnosis must say 'unknown'."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .flight import Air, Landings, Slices
from .parcels import Parcels
from .truths import Scene, Truth, with_drift


class MaskingTape(Truth):
    """A strip across the door, half shadowed by a lifted masking tape, takes less paint."""

    id, family, typical, unit = 'unknown:masking_tape', 'unknown', 0.25, '1'
    most = 0.95

    @classmethod
    def details(cls, rng):
        return {
            'angle_rad': rng.uniform(0.0, np.pi),
            'width_m': rng.uniform(0.06, 0.14),
            'at': rng.uniform(-0.2, 0.2, 2),
        }

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

    @classmethod
    def details(cls, rng):
        return {'wavelength_m': rng.uniform(0.25, 0.50), 'phase_rad': rng.uniform(0, 2 * np.pi)}

    def on_film(self, film_um, x, z, scene, film_at):
        wave = 2 * np.pi * x / self.drawn['wavelength_m'] + self.drawn['phase_rad']
        return film_um * (1.0 + self.amplitude * np.sin(wave))


class PoorGround(Truth):
    """A bolted-on patch is badly grounded and attracts less."""

    id, family, typical, unit = 'unknown:poor_ground', 'unknown', 0.12, '1'
    most = 0.9

    @classmethod
    def details(cls, rng):
        return {'at': rng.uniform(0.2, 0.8, 2), 'radius_m': rng.uniform(0.12, 0.22)}

    def on_landing(self, landings: Landings, scene: Scene) -> np.ndarray | float:
        if scene.part.kind != 'door':
            return 1.0
        part = scene.part
        x = landings.position_m[:, 0] - (self.drawn['at'][0] - 0.5) * part.width_m
        z = landings.position_m[:, 2] - self.drawn['at'][1] * part.height_m
        outside = np.hypot(x, z) - self.drawn['radius_m']
        return 1.0 - self.amplitude / (1.0 + np.exp(outside / 0.010))


class LocalBump(Truth):
    """A dripping bell leaves a soft spot of more paint."""

    id, family, typical, unit = 'unknown:local_bump', 'unknown', 0.12, '1'
    most = 1.0

    @classmethod
    def details(cls, rng):
        return {'at': rng.uniform(0.15, 0.85, 2), 'radius_m': rng.uniform(0.06, 0.16)}

    def on_landing(self, landings: Landings, scene: Scene) -> np.ndarray | float:
        part = scene.part
        x = landings.position_m[:, 0] - (self.drawn['at'][0] - 0.5) * part.width_m
        z = landings.position_m[:, 2] - self.drawn['at'][1] * part.height_m
        return 1.0 + self.amplitude * np.exp(-0.5 * (x**2 + z**2) / self.drawn['radius_m'] ** 2)


class PumpPulsation(Truth):
    """A worn gear pump: the flow swings with a period of a few pattern radii of travel."""

    id, family, typical, unit = 'unknown:pump_pulsation', 'unknown', 0.15, '1'
    most = 0.8

    @classmethod
    def details(cls, rng):
        return {'travel_m': rng.uniform(0.5, 0.9), 'phase_rad': rng.uniform(0, 2 * np.pi)}

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

    @classmethod
    def details(cls, rng):
        return {'period_s': rng.uniform(4.0, 9.0), 'phase_rad': rng.uniform(0, 2 * np.pi)}

    def on_air(self, air: Air, slices: Slices, parcels: Parcels) -> Air:
        angle = 2 * np.pi * slices.time_0_s / self.drawn['period_s'] + self.drawn['phase_rad']
        swing = (
            np.cos(angle)[:, None] * slices.turn_0[:, :, 0]
            + np.sin(angle)[:, None] * slices.turn_0[:, :, 1]
        )
        return with_drift(air, self.amplitude * swing)
