"""What the picture of profiles shows, as plain arrays: another process may draw it."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class ModelLine:
    """A model in one chart.

    Attributes:
        name: in the legend.
        film_um: (L,) along the chart's line, or (n,) at its readings where it has no line [um].
        residual_um: (n,) measured minus predicted [um].
        colour, width: of the film's line, its width in pixels.
        residual_colour: of the residual.
    """

    name: str
    film_um: np.ndarray
    residual_um: np.ndarray
    colour: str
    width: float
    residual_colour: str


@dataclass(frozen=True)
class ProfileChart:
    """One column or row of readings.

    Attributes:
        title: the readings and the models' errors.
        axis: what positions are measured along, in words.
        position_m: (n,) of the readings [m].
        measured_um: (n,) [um].
        bars_um: (n,) half of the intervals that hold 95 % [um].
        line_m: (L,) positions of the models' lines [m]; empty where there are too few readings.
        passes_um: (passes, L) paint that each single pass brought [um].
        models: base first.
    """

    title: str
    axis: str
    position_m: np.ndarray
    measured_um: np.ndarray
    bars_um: np.ndarray
    line_m: np.ndarray
    passes_um: np.ndarray
    models: tuple[ModelLine, ...]
