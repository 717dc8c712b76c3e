"""Sensitivities: derivatives of the predicted readings by the amplitudes of each effect."""

from dataclasses import dataclass
from itertools import product

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.inference.fitting.forward import Forward
from paint_deposition.inference.fitting.least_squares import Fit

# Amplitudes are stepped by this share of their typical size.
STEP = 0.25
# Values that are tried for each shape parameter.
SHAPES = 5


@dataclass(frozen=True)
class Sensitivity:
    """Sensitivity of the readings to one effect, for one choice of its shape parameters."""

    effect: Effect  # at the point of linearisation
    names: tuple[str, ...]  # of the n amplitudes
    # (P, n) derivative of the readings by each amplitude in its typical size, over the noise.
    columns: np.ndarray
    # (n,) bounds of the amplitudes, from neutral, in typical sizes.
    low: np.ndarray
    high: np.ndarray

    @property
    def id(self) -> str:
        """The effect's id."""
        return self.effect.id

    @property
    def sides(self) -> np.ndarray:
        """(n,) +1 where only growth above neutral is physical, -1 below, 0 either."""
        return 1.0 * (self.low >= 0.0) - 1.0 * (self.high <= 0.0)

    def with_amplitudes(self, amounts: np.ndarray) -> Effect:
        """The effect with amplitudes (n,) in their typical sizes, within its bounds."""
        info = type(self.effect).parameters()
        values = {
            name: float(np.clip(
                info[name]['neutral'] + info[name]['typical'] * amount,
                info[name]['low'],
                info[name]['high'],
            ))
            for name, amount in zip(self.names, amounts, strict=True)
        }  # fmt: skip
        return self.effect.model_copy(update=values)


def neutral_shapes(effect: type[Effect]) -> list[Effect]:
    """The effect at neutral amplitude, for a few values of its shape parameters."""
    info = effect.parameters()
    shapes = [name for name in info if info[name]['role'] == 'shape']
    grids = [
        np.geomspace(info[name]['low'], info[name]['high'], SHAPES + 2)[1:-1] for name in shapes
    ]
    return [
        effect(**dict(zip(shapes, map(float, values), strict=True))) for values in product(*grids)
    ]


def mark_um(
    forward: Forward, model: DepositionModel, effect: Effect, name: str, predicted_um: np.ndarray
) -> np.ndarray:
    """(P,) change of the predicted readings by an amplitude, in its typical size [um].

    Args:
        forward: predicts the points.
        model: where to linearise.
        effect: as it is there, in the model or neutral.
        name: of the amplitude; a bound beside it makes the difference one-sided.
        predicted_um: (P,) by the model with the effect.
    """
    info = type(effect).parameters()[name]
    here, step = getattr(effect, name), STEP * info['typical']
    ends = [value for value in (here - step, here + step) if info['low'] <= value <= info['high']]
    moved = [
        forward.predict_um(model.with_effect(effect.model_copy(update={name: value})))
        for value in ends
    ]
    if len(ends) == 2:
        return (moved[1] - moved[0]) / (2.0 * STEP)
    return (moved[0] - predicted_um) / (STEP if ends[0] > here else -STEP)


def sensitivity(forward: Forward, fit: Fit, effect: Effect, sigma_um: np.ndarray) -> Sensitivity:
    """Differentiate the prediction by the effect's amplitudes at the fitted model.

    Args:
        forward: predicts the points.
        fit: where to linearise.
        effect: neutral, or as it is in the fitted model.
        sigma_um: (P,) standard deviation of the points [um].
    """
    info = type(effect).parameters()
    names = type(effect).amplitudes()
    columns, lows, highs = [], [], []
    base = forward.predict_um(fit.model.with_effect(effect))
    for name in names:
        neutral, typical = info[name]['neutral'], info[name]['typical']
        columns.append(mark_um(forward, fit.model, effect, name, base) / sigma_um)
        lows.append((info[name]['low'] - neutral) / typical)
        highs.append((info[name]['high'] - neutral) / typical)
    return Sensitivity(effect, names, np.column_stack(columns), np.array(lows), np.array(highs))
