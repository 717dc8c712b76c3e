"""Evenness against paint and time: what several weights of the paint lead to."""

from dataclasses import dataclass

# From evenness alone to paint above all, in units of sigma_n squared.
PAINT_WEIGHTS = (0.0, 1e-3, 3e-3, 1e-2, 3e-2)


@dataclass(frozen=True)
class Point:
    """A result of one weight, as ``pareto.csv`` has it."""

    paint_weight: float
    sigma_n: float
    mean_um: float
    paint_cm3: float
    cycle_time_s: float
    passes: int
