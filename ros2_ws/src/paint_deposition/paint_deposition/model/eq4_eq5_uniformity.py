"""Evenness of a film laid by parallel passes: eqs. (4) and (5) of Conner et al. (IROS 2002)."""

import math
from dataclasses import dataclass

import numpy as np

from paint_deposition.model.eq3_collapse import Collapse


@dataclass(frozen=True)
class ParallelPasses:
    """Endless parallel passes at an even index."""

    first: Collapse  # collapse of every other pass, one of them at x = 0
    second: Collapse  # collapse of the passes between; the same object if all passes are alike

    @staticmethod
    def one_way(collapse: Collapse) -> 'ParallelPasses':
        """All passes alike, as in eq. (4)."""
        return ParallelPasses(collapse, collapse)

    @property
    def alike(self) -> bool:
        """Whether all passes lay one profile, so that the film repeats with every pass."""
        return self.first is self.second

    def mean_um(self, index_m: float) -> float:
        """Mean film [um]: the area of a pass spread over the index."""
        return 0.5 * (self.first.area_um_m + self.second.area_um_m) / index_m

    def period_m(self, index_m: float) -> float:
        """Distance after which the film repeats [m]."""
        return index_m if self.alike else 2.0 * index_m

    def thickness_um(self, index_m: float, x_m: np.ndarray) -> np.ndarray:
        """Eq. (4): T(x) [um] at x (N,) [m]."""
        x = np.asarray(x_m, dtype=float)
        period = self.period_m(index_m)
        film = np.zeros(x.shape)
        for collapse, start in self._rows(index_m):
            lowest = math.floor((x.min() - start - collapse.reach_m) / period)
            highest = math.ceil((x.max() - start + collapse.reach_m) / period)
            centres = start + period * np.arange(lowest, highest + 1)
            film += collapse.thickness_um(x[..., np.newaxis] - centres).sum(axis=-1)
        return film

    def sigma_n(self, index_m: float) -> float:
        """Eq. (5): standard deviation of the film over its mean, over one period."""
        return float(self.sigma_n_at(np.array([index_m]))[0])

    def sigma_n_at(self, index_m: np.ndarray) -> np.ndarray:
        """(N,) eq. (5) at indexes (N,) [m], each the same to the last bit as by itself.

        Even points over a period of a smooth periodic function: exact to rounding once they
        resolve the collapse.
        """
        period = np.array([self.period_m(value) for value in index_m.tolist()])
        finest = min(self.first.finest_m, self.second.finest_m)
        # So many in the collapse's finest scale: the rule converges faster than any power.
        points = np.maximum(32, 8.0 * period / finest)
        # Powers of two, so that many indexes have as many and are computed together.
        points = 2 ** np.ceil(np.log2(points)).astype(np.int64)
        found = np.empty(len(index_m))
        for count in np.unique(points).tolist():
            rows = points == count
            every_m = period[rows]
            x = every_m[:, np.newaxis] * np.arange(count) / count
            film = np.zeros(x.shape)
            for collapse, row in self._rows(1.0):
                start, reach = row * index_m[rows], collapse.reach_m
                lowest = math.floor(np.min((-start - reach) / every_m))
                highest = math.ceil(np.max((every_m - start + reach) / every_m))
                lines = start + np.arange(lowest, highest + 1)[:, np.newaxis] * every_m
                away = x - lines[:, :, np.newaxis]
                laid = np.where(np.abs(away) <= reach, collapse.thickness_um(away), 0.0)
                # One pass after the other: passes out of reach change no bit.
                film += laid.sum(axis=0)
            found[rows] = film.std(axis=1) / film.mean(axis=1)
        return found

    def _rows(self, index_m: float) -> list[tuple[Collapse, float]]:
        if self.alike:
            return [(self.first, 0.0)]
        return [(self.first, 0.0), (self.second, index_m)]
