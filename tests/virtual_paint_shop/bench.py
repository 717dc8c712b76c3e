"""The bench: one job painted with any truths, as often as one likes."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from .flight import Air, Landings, Slices, film_um, fly
from .jobs import Job, slices
from .parcels import Parcels, Pattern, conner_plume
from .truths import Scene, Truth, changes_flight

POOL = 1 << 19


class Bench:
    """Paints one job with any truths, always with the same parcels."""

    def __init__(
        self, seed: int, job: Job, pattern: Pattern, parcels: int,
        brushes: Mapping[int, Pattern] = MappingProxyType({}),
    ) -> None:  # fmt: skip
        """Where the plan names brushes, each paints its own passes with its pattern."""
        self.scene = Scene(job.part, pattern, job.motion)
        self.parcels_total = parcels
        self.plume = conner_plume(pattern, POOL, seed=seed)
        self._clean_landings = {}
        numbers = sorted(set(job.plan.brushes))
        self._brushes = [
            Bench(seed + n, job.of_brush(n), brushes[n], parcels // len(numbers)) for n in numbers
        ]

    def readings(
        self, truths: list[Truth], x: np.ndarray, z: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """(film, what a noise-free gauge says) at the points, um."""
        scene = self.scene
        film = self.film_at(truths, x, z)
        for truth in truths:
            film = truth.on_film(film, x, z, scene, lambda gx, gz: self.film_at(truths, gx, gz))
        reading = film
        for truth in truths:
            reading = truth.on_gauge(reading, x, z, scene)
        return film, reading

    def film_at(self, truths: list[Truth], x: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Film of the parcels that land and stay, um."""
        if self._brushes:
            return sum(brush.film_at(truths, x, z) for brush in self._brushes)
        landings = self._landings(truths, x, z)
        kept = 1.0
        for truth in truths:
            kept = kept * truth.on_landing(landings, self.scene)
        return film_um(landings, x.size, kept)

    def _landings(self, truths: list[Truth], x: np.ndarray, z: np.ndarray) -> Landings:
        flying = [t for t in truths if changes_flight(t)]
        key = (x.tobytes(), z.tobytes())
        if not flying and key in self._clean_landings:
            return self._clean_landings[key]
        nominal, pattern = self.scene.nominal, self.scene.pattern
        plume, motion = self.plume, nominal
        flow = lambda t: pattern.K1_cm3_per_s * nominal.commanded(t)  # noqa: E731
        for truth in flying:
            plume = truth.on_plume(plume, pattern)
            motion = truth.on_motion(motion, self.scene)
            flow = truth.on_flow(flow, self.scene)
        spraying = slices(motion, flow)
        air = still_air(spraying, plume)
        for truth in flying:
            air = truth.on_air(air, spraying, plume)
        part = self.scene.part
        landings = fly(part, spraying, plume, air, part.point(x, z), pattern.model_plane_m,
                       pattern.emission_offset_m, self.parcels_total)  # fmt: skip
        if not flying:
            self._clean_landings[key] = landings
        return landings


def still_air(spraying: Slices, plume: Parcels) -> Air:
    return Air(np.zeros_like(spraying.tcp_0_m), np.zeros_like(plume.x_m))
