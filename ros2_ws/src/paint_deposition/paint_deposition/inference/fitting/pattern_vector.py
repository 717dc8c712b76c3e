"""The entries of a fit's vector for the patterns of a model.

One pattern has the coordinates of ``model/eq1_pattern.py``. Of several brushes the first has them
all. Each other has its own too, but the phase of the asymmetry is the bell's and shared: in its
place stands the logarithm of its K3 over that of the first. From job to job brushes change nearly
alike: what is known of one job makes its brushes move together in the next.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from paint_deposition.model.eq1_pattern import PATTERN, Coordinate, PlanarPattern

PATTERN_NAMES = ('K1_cm3_per_s', 'K2', 'K3', 'phi_rad', 'r_m', 'sigma1_m', 'sigma2_m')
COS, SIN = 2, 3
# Weak: between brushes the asymmetry keeps its order of magnitude.
RATIO = Coordinate('log_K3_ratio', 0.0, 0.5, -2.0, 2.0, 0.06)
# Share of the variance between jobs that all brushes share: batch, viscosity and wear of the cup
# are common, the settings are each brush's own. An assumption.
SHARED_VARIANCE = 0.9
# A ratio has no value where the first brush has less asymmetry.
LEAST_K3 = 1e-3


@dataclass(frozen=True)
class PatternVector:
    """Positions of the patterns in the vector."""

    brushes: tuple[int, ...] = ()  # their numbers; a single pattern needs none

    @property
    def count(self) -> int:
        """Number of patterns, B."""
        return max(len(self.brushes), 1)

    @cached_property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """Coordinate of each entry; those of several brushes are named 'brush_2.K2' say."""
        if self.count == 1:
            return PATTERN
        own = (*PATTERN[:COS], RATIO, *PATTERN[SIN + 1 :])
        return tuple(
            replace(coordinate, name=f'{self._prefix(row)}{coordinate.name}')
            for row in range(self.count)
            for coordinate in (own if row else PATTERN)
        )

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the 7 B parameters in the model's units."""
        return tuple(f'{self._prefix(row)}{n}' for row in range(self.count) for n in PATTERN_NAMES)

    def _prefix(self, row: int) -> str:
        return f'brush_{self.brushes[row]}.' if self.count > 1 else ''

    def __len__(self) -> int:
        return len(self.coordinates)

    def entries(self, row: int) -> np.ndarray:
        """(7,) entries on which the coordinates of a pattern rest; the asymmetry's are shared."""
        if row == 0:
            return np.arange(len(PATTERN))
        begin = len(PATTERN) + (row - 1) * (len(PATTERN) - 1)
        return np.array([begin, begin + 1, COS, SIN, begin + 3, begin + 4, begin + 5])

    def _ratio(self, row: int) -> int:
        """Entry of the ratio of a pattern that is not the first."""
        return int(self.entries(row)[1]) + 1

    def shared_covariance(self, deviations: np.ndarray) -> np.ndarray:
        """(k, k) covariance with these standard deviations (k,) if all brushes change together.

        A ratio to the first brush changes by itself.
        """
        names = np.array([c.name.rpartition('.')[2] for c in self.coordinates])
        same = (names[:, np.newaxis] == names) & (names != RATIO.name)
        return np.outer(deviations, deviations) * (same | np.eye(len(names), dtype=bool))

    @property
    def between_jobs(self) -> np.ndarray:
        """(k, k) covariance of the entries between jobs, most of it in all brushes alike."""
        deviations = np.array([c.between_jobs for c in self.coordinates])
        own = np.diag(deviations**2)
        return SHARED_VARIANCE * self.shared_covariance(deviations) + (1.0 - SHARED_VARIANCE) * own

    def of_patterns(self, vectors: np.ndarray) -> np.ndarray:
        """(n, B, 7) coordinates of each pattern for vectors (n, k); K3 may exceed 1."""
        found = np.stack([vectors[:, self.entries(row)] for row in range(self.count)], axis=1)
        for row in range(1, self.count):
            found[:, row, [COS, SIN]] *= np.exp(vectors[:, [self._ratio(row)]])
        return found

    def jacobian(self, vector: np.ndarray) -> np.ndarray:
        """(7 B, k) derivative of the patterns' coordinates, where K3 <= 1, by the entries (k,)."""
        size = len(PATTERN)
        found = np.zeros((size * self.count, len(self)))
        for row, own in enumerate(self.of_patterns(vector[np.newaxis])[0]):
            block = found[size * row : size * (row + 1)]
            block[np.arange(size), self.entries(row)] = 1.0
            asymmetry = block[[COS, SIN]]
            if row:
                asymmetry[:, [COS, SIN]] *= np.exp(vector[self._ratio(row)])
                asymmetry[:, self._ratio(row)] = own[[COS, SIN]]
            # Of K3 cos(phi) and K3 sin(phi), where K3 <= 1, by free ones.
            free, slopes = own[[COS, SIN]], np.eye(2)
            if (k3 := np.hypot(*free)) > 1.0:
                slopes = (slopes - np.outer(free, free) / k3**2) / k3
            block[[COS, SIN]] = slopes @ asymmetry
        return found

    def subset(self, whole: 'PatternVector', vector: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The entries (k,) of some of the brushes, and their derivative (k, n) by those of all."""
        rows = [whole.brushes.index(number) for number in self.brushes]
        slope = np.zeros((len(self), len(whole)))
        for row, there in enumerate(rows):
            slope[self.entries(row), whole.entries(there)] = 1.0
            if row:
                slope[self._ratio(row), whole._ratio(there)] = 1.0
        entries = slope @ vector
        if rows[0]:
            # Asymmetries that were relative to that of a brush which is left out.
            left_out = whole._ratio(rows[0])
            ratios = [self._ratio(row) for row in range(1, self.count)]
            entries[ratios] -= vector[left_out]
            slope[ratios, left_out] = -1.0
            growth = np.exp(vector[left_out])
            entries[[COS, SIN]] *= growth
            slope[[COS, SIN]] *= growth
            slope[[COS, SIN], left_out] = entries[[COS, SIN]]
        return entries, slope

    def encode(self, patterns: Sequence[PlanarPattern]) -> list[float]:
        """The entries of these patterns."""
        found: list[float] = []
        for row, p in enumerate(patterns):
            asymmetry = [p.K3 * np.cos(p.phi_rad), p.K3 * np.sin(p.phi_rad)]
            if row:
                asymmetry = [np.log(max(p.K3, LEAST_K3) / max(patterns[0].K3, LEAST_K3))]
            widths = np.log(p.sigma1_m), np.log(p.sigma2_m)
            found += [np.log(p.K1_cm3_per_s), p.K2, *asymmetry, p.r_m, *widths]
        return found

    def values(self, vectors: np.ndarray) -> np.ndarray:
        """(n, 7 B) parameters in the model's units, see ``names``, for vectors (n, k)."""
        of = np.moveaxis(self.of_patterns(vectors), 2, 0)
        log_k1, k2, cos, sin, r, log_sigma1, log_sigma2 = of
        k3, phi = np.minimum(np.hypot(cos, sin), 1.0), np.arctan2(sin, cos)
        columns = [np.exp(log_k1), k2, k3, phi, r, np.exp(log_sigma1), np.exp(log_sigma2)]
        return np.stack(columns, axis=2).reshape(len(vectors), -1)

    def patterns(self, values: Sequence[float]) -> list[PlanarPattern]:
        """The patterns of parameters (7 B,)."""
        each = np.reshape(values, (self.count, -1)).tolist()
        return [PlanarPattern(**dict(zip(PATTERN_NAMES, own, strict=True))) for own in each]
