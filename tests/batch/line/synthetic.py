"""Parts of a line without any painting: linear in everything, with known truth."""

import numpy as np

from paint_deposition.batch.line.pooling import Measured, amplitudes

HOUR_S = 3600.0
FIRST_S = 1.793e9
SIGMA_UM = 0.7


def parts(
    count: int, seed: int, *, level=0.01, points=12, drift=0.0, misfit=0.0, steps=(), pattern=7
) -> list[Measured]:
    """``count`` parts an hour apart, measured at the same points.

    level: standard deviation of the parts. drift: (count,) or one amplitude of the first effect,
    in typical sizes. misfit: of each point, a share. steps: (row, share) changes of the level.
    pattern: how many coordinates it has, more than 7 with several brushes.
    """
    rng = np.random.default_rng([4, seed])
    film = 25.0 + 3.0 * np.sin(np.arange(points))
    by_pattern = film[:, np.newaxis] * rng.normal(size=(points, pattern))
    by_pattern[:, 0] = film  # K1
    by_effect = rng.normal(size=(points, len(amplitudes())))
    places = np.column_stack([0.2 * np.arange(points), np.zeros(points), np.zeros(points)])
    shared = by_pattern @ (0.03 * rng.normal(size=pattern))
    shared = shared + misfit * film * rng.normal(size=points)
    amount = np.broadcast_to(drift, count)
    found = []
    for row in range(count):
        share = level * rng.normal() + sum(size for at, size in steps if row >= at)
        residual = shared + share * film + amount[row] * by_effect[:, 0]
        residual = residual + SIGMA_UM * rng.normal(size=points)
        found.append(Measured(
            f'part_{row}', FIRST_S + HOUR_S * row, residual, np.full(points, SIGMA_UM), film,
            places, by_pattern, by_effect,
        ))  # fmt: skip
    return found
