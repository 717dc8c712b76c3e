"""The free parameters of a fit as one vector, and the model that a vector stands for.

The vector holds smooth coordinates of the pattern: logarithms of what is positive, and the
asymmetry as K3 cos(phi) and K3 sin(phi), so that phi is well-behaved when K3 vanishes. Amplitudes
of effects are in units of their typical size.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.model.pattern import PlanarPattern


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
class FreeParameters:
    """The parameters of a model that are varied.

    Attributes:
        start: the model that fixes everything else, effects included.
        varied: (effect id, parameter name) of the amplitudes that are varied.
    """

    start: DepositionModel
    varied: tuple[tuple[str, str], ...] = ()

    @staticmethod
    def of(start: DepositionModel, *effects: Effect) -> 'FreeParameters':
        """The pattern and all amplitudes of these effects; those the model lacks are added."""
        for effect in effects:
            if start.effect(effect.id) is None:
                start = start.with_effect(effect)
        varied = [(e.id, name) for e in effects for name in type(e).amplitudes()]
        return FreeParameters(start, tuple(varied))

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each entry."""
        return tuple(c.name for c in PATTERN) + tuple(f'{e}.{n}' for e, n in self.varied)

    def __len__(self) -> int:
        return len(PATTERN) + len(self.varied)

    @cached_property
    def _amplitudes(self) -> list[dict]:
        known = {e.id: e.parameters() for e in self.start.effects}
        return [known[e][n] for e, n in self.varied]

    @property
    def typical(self) -> np.ndarray:
        """(A,) typical size of each amplitude, its unit in the vector."""
        return np.array([info['typical'] for info in self._amplitudes])

    @property
    def neutral(self) -> np.ndarray:
        """(A,) value of each amplitude at which its effect is absent."""
        return np.array([info['neutral'] for info in self._amplitudes])

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bounds of the vector."""
        low = [c.low for c in PATTERN]
        high = [c.high for c in PATTERN]
        for info in self._amplitudes:
            ends = sorted(
                (info[side] - info['neutral']) / info['typical'] for side in ('low', 'high')
            )
            low.append(ends[0])
            high.append(ends[1])
        return np.array(low), np.array(high)

    @property
    def prior(self) -> tuple[np.ndarray, np.ndarray]:
        """Centre and standard deviation of the vector's independent normal priors."""
        centre = [c.centre for c in PATTERN] + [0.0] * len(self.varied)
        width = [c.width for c in PATTERN] + [1.0] * len(self.varied)
        return np.array(centre), np.array(width)

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
        for (effect_id, name), info in zip(self.varied, self._amplitudes, strict=True):
            value = getattr(model.effect(effect_id), name)
            entries.append((value - info['neutral']) / info['typical'])
        return np.clip(np.array(entries), *self.bounds)

    def decode(self, vector: np.ndarray) -> DepositionModel:
        """The model of a vector."""
        log_k1, k2, k3_cos, k3_sin, r, log_s1, log_s2 = (float(v) for v in vector[:7])
        planar = PlanarPattern(
            K1_cm3_per_s=np.exp(log_k1),
            K2=k2,
            K3=min(np.hypot(k3_cos, k3_sin), 1.0),
            phi_rad=np.arctan2(k3_sin, k3_cos),
            r_m=r,
            sigma1_m=np.exp(log_s1),
            sigma2_m=np.exp(log_s2),
        )
        changed: dict[str, dict[str, float]] = {}
        amplitudes = vector[len(PATTERN) :]
        for (effect_id, name), info, value in zip(
            self.varied, self._amplitudes, amplitudes, strict=True
        ):
            wanted = info['neutral'] + info['typical'] * float(value)
            inside = min(max(wanted, info['low']), info['high'])
            changed.setdefault(effect_id, {})[name] = inside
        effects = tuple(
            e.model_copy(update=changed[e.id]) if e.id in changed else e
            for e in self.start.effects
        )
        return self.start.model_copy(update={'planar': planar, 'effects': effects})
