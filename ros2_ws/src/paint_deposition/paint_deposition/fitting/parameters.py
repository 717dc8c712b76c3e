"""The free parameters of a fit as one vector, and the model that a vector stands for.

The vector holds smooth coordinates of the pattern: logarithms of what is positive, and the
asymmetry as K3 cos(phi) and K3 sin(phi), so that phi is well-behaved when K3 vanishes. Amplitudes
of effects are in units of their typical size, shapes logarithms of the ratio to their default.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.fitting.prior import Prior
from paint_deposition.model.pattern import PlanarPattern

# The range that is physical for a shape parameter is this many standard deviations of its prior.
SHAPE_DEVIATIONS = 4.0


@dataclass(frozen=True)
class Coordinate:
    """One entry of the vector for the pattern: weak prior and bounds."""

    name: str
    centre: float
    width: float
    low: float
    high: float


# Weak priors: any bell's pattern lies well within two widths. They only keep finite what the
# readings do not determine.
PATTERN = (
    Coordinate('log_K1', np.log(2.0), 2.0, np.log(1e-3), np.log(99.0)),
    Coordinate('K2', 0.3, 0.4, 0.0, 1.0),
    Coordinate('K3_cos_phi', 0.0, 0.4, -0.99, 0.99),
    Coordinate('K3_sin_phi', 0.0, 0.4, -0.99, 0.99),
    Coordinate('r_m', 0.2, 0.15, 0.0, 0.99),
    Coordinate('log_sigma1', np.log(0.09), 0.7, np.log(0.006), np.log(0.9)),
    Coordinate('log_sigma2', np.log(0.14), 0.7, np.log(0.006), np.log(0.9)),
)
PATTERN_NAMES = ('K1_cm3_per_s', 'K2', 'K3', 'phi_rad', 'r_m', 'sigma1_m', 'sigma2_m')


@dataclass(frozen=True)
class EffectParameter:
    """One entry of the vector for an effect: an amplitude, or a shape such as a length.

    Attributes:
        effect: id. name: of the parameter.
        neutral, low, high: its neutral (for a shape: default) value and its bounds.
        unit: an amplitude's typical size; for a shape, the logarithm that counts as one.
        is_shape: whether it is a shape.
    """

    effect: str
    name: str
    neutral: float
    low: float
    high: float
    unit: float
    is_shape: bool

    @staticmethod
    def of(effect: Effect, name: str) -> 'EffectParameter':
        """The entry of an effect's parameter."""
        info = effect.parameters()[name]
        is_shape = info['role'] == 'shape'
        low, high = info['low'], info['high']
        unit = np.log(high / low) / SHAPE_DEVIATIONS if is_shape else info['typical']
        return EffectParameter(effect.id, name, info['neutral'], low, high, unit, is_shape)

    def encode(self, value: float) -> float:
        """The vector's entry for a value."""
        if self.is_shape:
            return float(np.log(value / self.neutral) / self.unit)
        return (value - self.neutral) / self.unit

    def decode(self, entry: np.ndarray) -> np.ndarray:
        """Values for entries, kept within the bounds; arrays of any shape."""
        entry = np.asarray(entry, dtype=float)
        value = (
            self.neutral * np.exp(self.unit * entry)
            if self.is_shape
            else self.neutral + self.unit * entry
        )
        return np.clip(value, self.low, self.high)


@dataclass(frozen=True)
class FreeParameters:
    """The parameters of a model that are varied.

    Attributes:
        start: the model that fixes everything else, effects included.
        varied: (effect id, parameter name) of the amplitudes and shapes that are varied.
    """

    start: DepositionModel
    varied: tuple[tuple[str, str], ...] = ()

    @staticmethod
    def of(start: DepositionModel, *effects: Effect) -> 'FreeParameters':
        """The pattern and all parameters of these effects; those the model lacks are added."""
        for effect in effects:
            if start.effect(effect.id) is None:
                start = start.with_effect(effect)
        varied = [(e.id, name) for e in effects for name in e.parameters()]
        return FreeParameters(start, tuple(varied))

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each entry."""
        return tuple(c.name for c in PATTERN) + tuple(f'{e}.{n}' for e, n in self.varied)

    def __len__(self) -> int:
        return len(PATTERN) + len(self.varied)

    @cached_property
    def of_effects(self) -> tuple[EffectParameter, ...]:
        """The entries behind those of the pattern."""
        known = {effect.id: effect for effect in self.start.effects}
        return tuple(EffectParameter.of(known[e], n) for e, n in self.varied)

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bounds of the vector."""
        ends = [(c.low, c.high) for c in PATTERN]
        for entry in self.of_effects:
            first, second = sorted((entry.encode(entry.low), entry.encode(entry.high)))
            ends.append((first, second))
        low, high = zip(*ends, strict=True)
        return np.array(low), np.array(high)

    @property
    def prior(self) -> Prior:
        """Of the vector: independent and weak."""
        centre = [c.centre for c in PATTERN] + [0.0] * len(self.varied)
        width = [c.width for c in PATTERN] + [1.0] * len(self.varied)
        return Prior(np.array(centre), np.diag(width))

    def encode(self, model: DepositionModel) -> np.ndarray:
        """The vector of a model that has the varied effects, kept inside the bounds."""
        p = model.planar
        entries = [
            np.log(p.K1_cm3_per_s),
            p.K2,
            p.K3 * np.cos(p.phi_rad),
            p.K3 * np.sin(p.phi_rad),
            p.r_m,
            np.log(p.sigma1_m),
            np.log(p.sigma2_m),
        ]
        entries += [e.encode(getattr(model.effect(e.effect), e.name)) for e in self.of_effects]
        return np.clip(np.array(entries), *self.bounds)

    def values(self, vectors: np.ndarray) -> np.ndarray:
        """(n, k) parameters in the model's units, pattern first, for vectors (n, k)."""
        log_k1, k2, k3_cos, k3_sin, r, log_sigma1, log_sigma2 = vectors[:, : len(PATTERN)].T
        pattern = [
            np.exp(log_k1),
            k2,
            np.minimum(np.hypot(k3_cos, k3_sin), 1.0),
            np.arctan2(k3_sin, k3_cos),
            r,
            np.exp(log_sigma1),
            np.exp(log_sigma2),
        ]
        amounts = [
            entry.decode(column)
            for entry, column in zip(self.of_effects, vectors[:, len(PATTERN) :].T, strict=True)
        ]
        return np.column_stack([*pattern, *amounts])

    def decode(self, vector: np.ndarray) -> DepositionModel:
        """The model of a vector."""
        values = [float(value) for value in self.values(vector[np.newaxis])[0]]
        planar = PlanarPattern(**dict(zip(PATTERN_NAMES, values, strict=False)))
        changed: dict[str, dict[str, float]] = {}
        for entry, value in zip(self.of_effects, values[len(PATTERN) :], strict=True):
            changed.setdefault(entry.effect, {})[entry.name] = value
        effects = tuple(
            e.model_copy(update=changed[e.id]) if e.id in changed else e
            for e in self.start.effects
        )
        return self.start.model_copy(update={'planar': planar, 'effects': effects})
