"""The parts of a line that were measured, in the order of time, ready for pooling."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

# Readings so near to each other are of one place of the part.
PLACE_M = 0.05


@dataclass(frozen=True)
class Measured:
    """One part and its P points.

    Attributes:
        name: of the part. time_s: when it was painted, seconds since 1970.
        residual_um, sigma_um, predicted_um: (P,) measured minus predicted; standard deviation;
            predicted [um].
        positions_m: (P, 3).
        by_pattern: (P, k) derivatives by the coordinates of the pattern, of all brushes [um].
        by_effect: (P, A) by each amplitude of the catalogue in its typical size [um].
    """

    name: str
    time_s: float
    residual_um: np.ndarray
    sigma_um: np.ndarray
    predicted_um: np.ndarray
    positions_m: np.ndarray
    by_pattern: np.ndarray
    by_effect: np.ndarray

    def __len__(self) -> int:
        return len(self.residual_um)


def measured_parts(columns: Mapping[str, Sequence[Any]]) -> list[Measured]:
    """The measured parts of the line's mesh among the rows of all runs, oldest first."""
    if 'measured_um' not in columns:
        return []
    rows_of: dict[str, list[int]] = {}
    told = zip(columns['part'], columns['measured_um'], columns['pooled'], strict=True)
    for row, (part, value, pooled) in enumerate(told):
        if value is not None and pooled:
            rows_of.setdefault(part, []).append(row)

    def taken(name: str, rows: list[int]) -> np.ndarray:
        return np.array([columns[name][row] for row in rows], dtype=float)

    found = [
        Measured(
            part, float(columns['time_s'][rows[0]]),
            taken('measured_um', rows) - taken('predicted_um', rows),
            taken('sigma_um', rows), taken('predicted_um', rows),
            np.column_stack([taken(f'{axis}_m', rows) for axis in 'xyz']),
            taken('by_pattern', rows), taken('by_effect', rows),
        )
        for part, rows in rows_of.items()
    ]  # fmt: skip
    return sorted(found, key=lambda part: part.time_s)


def places(parts: Sequence[Measured]) -> tuple[np.ndarray, np.ndarray]:
    """Places at which the line is measured: (F, 3) [m], and (N,) that of each point of all."""
    cells = np.round(np.concatenate([part.positions_m for part in parts]) / PLACE_M).astype(int)
    unique, place_of = np.unique(cells, axis=0, return_inverse=True)
    return unique * PLACE_M, place_of.ravel()
