"""A part painted by a given programme instead of one that the shop draws."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation
from tests.virtual_paint_shop.draw import stream
from tests.virtual_paint_shop.gauge import GaugeNoise
from tests.virtual_paint_shop.jobs import Job, Motion, Plan
from tests.virtual_paint_shop.parcels import Pattern
from tests.virtual_paint_shop.shop import PARCELS, Bench, Experiment, gauged
from tests.virtual_paint_shop.truths import Truth

# The gun stands below this share of its greatest speed: there a pass ends.
STANDS = 0.02
# A part's own level of film, as a share, and its gauge session's own zero [um].
LEVEL, SESSION_UM = 0.02, 0.3


def motion_of(
    time_s: np.ndarray, tcp_m: np.ndarray, quaternions_xyzw: np.ndarray, trigger_s: np.ndarray,
    trigger_on: np.ndarray,
) -> Motion:  # fmt: skip
    """The motion of n poses (n,), (n, 3), (n, 4), and e trigger events (e,).

    Passes go from standstill to standstill with the gun open in between.
    """
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(tcp_m, axis=0), axis=1))])
    speed = np.gradient(way, time_s)
    leg = np.cumsum(np.diff(speed < STANDS * speed.max(), prepend=True) != 0)
    opened = np.searchsorted(time_s, trigger_s[trigger_on])
    numbers = np.full(len(time_s), -1)
    for number, which in enumerate(np.unique(leg[np.minimum(opened, len(leg) - 1)])):
        numbers[leg == which] = number
    ends = way[np.flatnonzero(np.diff(numbers) != 0)]
    to_end = np.full(way.size, np.inf)
    if ends.size:
        to_end = np.min(np.abs(way[:, None] - ends[None, :]), axis=1)
    turn = Rotation.from_quat(quaternions_xyzw).as_matrix()
    return Motion(time_s, tcp_m, turn, numbers, to_end, trigger_s, trigger_on)


def driven(trajectory) -> Motion:
    """The motion of poses and triggers as a bag has them: stamps, positions, quaternions, flow."""
    start = trajectory.stamps_ns[0]
    return motion_of(
        (trajectory.stamps_ns - start) * 1e-9,
        trajectory.positions_m,
        trajectory.quaternions_xyzw,
        (trajectory.trigger_stamps_ns - start) * 1e-9,
        trajectory.trigger_flow > 0.0,
    )


@dataclass(frozen=True)
class Evenness:
    """Of a true film: its mean, standard deviation over it, and share within a tolerance of it."""

    mean_um: float
    sigma_n: float
    within: float

    @staticmethod
    def of(film_um: np.ndarray, tolerance: float = 0.05) -> Evenness:
        mean = film_um.mean()
        within = np.mean(np.abs(film_um - mean) <= tolerance * mean)
        return Evenness(float(mean), float(film_um.std() / mean), float(within))


class Painted:
    """A part painted by a motion, with hidden effects."""

    def __init__(
        self, name: str, part, pattern: Pattern, truths: list[Truth], motion: Motion, seed: int,
        parcels: int = PARCELS,
    ) -> None:  # fmt: skip
        # Of the plan only how the gun flows is asked for: the motion is given.
        self.job = Job(name, part, Plan(), motion)
        self.truths, self.seed = truths, seed
        self._bench = Bench(seed, self.job, pattern, parcels)

    def film_um(self, x_m: np.ndarray, z_m: np.ndarray) -> np.ndarray:
        """(n,) true film at points (n,) of the part [um]."""
        return self._bench.readings(self.truths, x_m, z_m)[0]

    def measured(self, x_m: np.ndarray, z_m: np.ndarray, noise: GaugeNoise | None) -> Experiment:
        """The part with readings at points (n,); without noise: the true film, not the gauge's."""
        film, expected = self._bench.readings(self.truths, x_m, z_m)
        rng = stream(self.seed, 80)
        level, offset = 1.0 + LEVEL * rng.normal(), SESSION_UM * rng.normal()
        if noise is None:
            noise, level, offset, expected = GaugeNoise(0.0, 0.002), 1.0, 0.0, film
        films = film, expected, film
        return gauged(self.job, x_m, z_m, films, noise, level, offset, rng)
