"""The free parameters of a fit as one vector, the model that a vector stands for, the posterior.

The vector holds the coordinates of the patterns, see ``pattern_vector``. Amplitudes of
effects are in units of their typical size, shapes logarithms of the ratio to their default.
The posterior is what a fit knows of them, as a section of the model file.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import zip_longest
from types import MappingProxyType
from typing import Annotated

import numpy as np
from pydantic import BaseModel, Field, model_validator
from scipy.linalg import block_diag, solve_triangular

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ModelError, did_you_mean
from paint_deposition.inference.fitting.pattern_vector import COS, SIN, PatternVector
from paint_deposition.model.eq1_pattern import EFFECT_BETWEEN_JOBS, PATTERN

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[Number, Field(gt=0.0)]
Factor = Annotated[Number, Field(ge=1.0)]
# What coordinates of a brush begin with.
BRUSH = 'brush_'
REMEDY = 'copy the whole section from the file that was written, or take it out'


class Posterior(BaseModel, frozen=True, extra='forbid'):
    """A normal distribution of a model's parameters, and what it rests on.

    The pattern is in the coordinates of ``model/eq1_pattern.py``; effects are in their own units,
    their shapes as logarithms.
    """

    mean: dict[str, Number] = Field(description='a number for each coordinate')
    covariance: dict[str, list[Number]] = Field(
        description='a row of numbers for each coordinate of the mean, in its order'
    )
    readings: tuple[str, ...] = Field((), description='fingerprints of the readings behind it')
    process: dict[str, Number] = Field({}, description='numbers by name')
    footprint: tuple[Positive, Factor] | None = Field(
        None,
        description='typical deviation of the footprint from the model, over its peak, and the '
        'factor by which that is uncertain (one standard deviation)',
    )

    @staticmethod
    def of(
        names: Sequence[str], centre: np.ndarray, matrix: np.ndarray, **more: object
    ) -> 'Posterior':
        """Normal distribution of k coordinates with mean (k,) and covariance (k, k)."""
        mean = dict(zip(names, centre.tolist(), strict=True))
        return Posterior.model_validate(
            {'mean': mean, 'covariance': dict(zip(names, matrix.tolist(), strict=True))} | more
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the k coordinates."""
        return tuple(self.mean)

    @property
    def centre(self) -> np.ndarray:
        """(k,) mean."""
        return np.array(list(self.mean.values()))

    @property
    def matrix(self) -> np.ndarray:
        """(k, k) covariance."""
        return np.array(list(self.covariance.values()))

    @model_validator(mode='after')
    def _is_a_distribution(self) -> 'Posterior':
        names = self.names
        of_brushes = any(name.startswith(BRUSH) for name in names)
        for pattern in () if of_brushes else PATTERN:
            if pattern.name not in names:
                raise ValueError(f'mean has no {pattern.name}; {REMEDY}')
        if tuple(self.covariance) != names:
            first = next(a or b for a, b in zip_longest(names, self.covariance) if a != b)
            raise ValueError(
                f'mean and covariance differ in {first}: both need the same names in the same '
                f'order; {REMEDY}'
            )
        for name, row in self.covariance.items():
            if len(row) != len(names):
                raise ValueError(
                    f'covariance.{name} has {len(row)} numbers; expected {len(names)}, one for '
                    'each coordinate of the mean'
                )
        matrix = self.matrix
        scale = np.sqrt(np.abs(np.outer(np.diag(matrix), np.diag(matrix))))
        # Largest relative difference between two entries that should be the same.
        skew = np.abs(matrix - matrix.T) > 1e-6 * scale
        if skew.any():
            i, j = np.argwhere(skew)[0]
            raise ValueError(
                f'covariance is not symmetric: {matrix[i, j]:g} in row {names[i]}, column '
                f'{names[j]}, but {matrix[j, i]:g} the other way; {REMEDY}'
            )
        try:
            np.linalg.cholesky(matrix)
        except np.linalg.LinAlgError:
            raise ValueError(f'covariance is not positive definite; {REMEDY}') from None
        return self

    def check_suits(self, model: DepositionModel) -> None:
        """Refuse coordinates that are none of the model's.

        Raises:
            ModelError: naming the first one.
        """
        shared = [c.name for c in PATTERN]
        known = [
            f'{BRUSH}{b.number}.{n}' for b in model.brushes for n in (*shared, 'log_K3_ratio')
        ]
        known += shared if len(model.brushes) <= 1 else []
        known += [f'{e.id}.{name}' for e in model.effects for name in e.coordinates().values()]
        for name in self.names:
            if name not in known:
                raise ModelError(
                    f'posterior: {name} is no parameter of this model; '
                    f'{did_you_mean(name, known, REMEDY)}'
                )


@dataclass(frozen=True)
class Prior:
    """A normal distribution, its covariance given by a square root."""

    centre: np.ndarray  # (k,) mean
    factor: np.ndarray  # (k, k) lower Cholesky factor of the covariance

    @cached_property
    def width(self) -> np.ndarray:
        """(k,) standard deviations."""
        return np.linalg.norm(self.factor, axis=1)

    @cached_property
    def whitening(self) -> np.ndarray:
        """(k, k) inverse of the factor."""
        return solve_triangular(self.factor, np.eye(len(self.factor)), lower=True)

    def whiten(self, vector: np.ndarray) -> np.ndarray:
        """(k,) deviations of a vector from the centre, independent and in standard deviations."""
        return self.whitening @ (vector - self.centre)


# The range that is physical for a shape parameter is this many standard deviations of its prior.
SHAPE_DEVIATIONS = 4.0


@dataclass(frozen=True)
class EffectParameter:
    """One entry of the vector for an effect: an amplitude, or a shape such as a length."""

    effect: str  # id
    name: str  # of the parameter
    # Its neutral (for a shape: default) value and its bounds.
    neutral: float
    low: float
    high: float
    unit: float  # an amplitude's typical size; for a shape, the logarithm that counts as one
    is_shape: bool  # whether it is a shape
    coordinate: str  # its name in a posterior, where it is ``offset`` + ``unit`` times the entry

    @staticmethod
    def of(effect: Effect, name: str) -> 'EffectParameter':
        """The entry of an effect's parameter."""
        info = effect.parameters()[name]
        is_shape, low, high = info['role'] == 'shape', info['low'], info['high']
        return EffectParameter(
            effect.id, name, info['neutral'], low, high,
            np.log(high / low) / SHAPE_DEVIATIONS if is_shape else info['typical'], is_shape,
            effect.coordinates()[name],
        )  # fmt: skip

    def encode(self, value: float) -> float:
        """The vector's entry for a value."""
        if self.is_shape:
            return float(np.log(value / self.neutral) / self.unit)
        return (value - self.neutral) / self.unit

    def decode(self, entry: np.ndarray) -> np.ndarray:
        """Values for entries, kept within the bounds; arrays of any shape."""
        away = self.unit * np.asarray(entry, dtype=float)
        value = self.neutral * np.exp(away) if self.is_shape else self.neutral + away
        return np.clip(value, self.low, self.high)


@dataclass(frozen=True)
class FreeParameters:
    """The parameters of a model that are varied."""

    start: DepositionModel  # the model that fixes everything else, effects included
    # (effect id, parameter name) of the amplitudes and shapes that are varied.
    varied: tuple[tuple[str, str], ...] = ()
    known: Posterior | None = None  # what is known of them from an earlier job, or None
    # Size of the amplitudes of an effect, times their typical one, by id; default: 1.
    amplitude_sizes: Mapping[str, float] = field(default_factory=dict)

    @staticmethod
    def of(
        start: DepositionModel,
        *effects: Effect,
        known: Posterior | None = None,
        amplitude_sizes: Mapping[str, float] = MappingProxyType({}),
    ) -> 'FreeParameters':
        """The pattern and all parameters of these effects; those the model lacks are added."""
        for effect in effects:
            if start.effect(effect.id) is None:
                start = start.with_effect(effect)
        varied = [(e.id, name) for e in effects for name in e.parameters()]
        return FreeParameters(start, tuple(varied), known, amplitude_sizes)

    @cached_property
    def pattern(self) -> PatternVector:
        """The entries for the patterns; they come first."""
        return PatternVector(tuple(brush.number for brush in self.start.brushes))

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the entries in a posterior: there it is ``offset`` + ``scale`` times one."""
        effects = (f'{e.effect}.{e.coordinate}' for e in self.of_effects)
        return (*(c.name for c in self.pattern.coordinates), *effects)

    @property
    def offset(self) -> np.ndarray:
        """(k,) values of a posterior's coordinates where the entries are zero."""
        own = [np.log(e.neutral) if e.is_shape else e.neutral for e in self.of_effects]
        return np.array([0.0] * len(self.pattern) + own)

    @property
    def scale(self) -> np.ndarray:
        """(k,) changes of a posterior's coordinates for one unit of the entries."""
        return np.array([1.0] * len(self.pattern) + [e.unit for e in self.of_effects])

    def __len__(self) -> int:
        return len(self.pattern) + len(self.varied)

    @cached_property
    def of_effects(self) -> tuple[EffectParameter, ...]:
        """The entries behind those of the pattern."""
        known = {effect.id: effect for effect in self.start.effects}
        return tuple(EffectParameter.of(known[e], n) for e, n in self.varied)

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bounds of the vector."""
        ends = [[c.low, c.high] for c in self.pattern.coordinates]
        ends += [sorted((e.encode(e.low), e.encode(e.high))) for e in self.of_effects]
        low, high = np.array(ends).T
        return low, high

    def are_physical(self, vectors: np.ndarray) -> np.ndarray:
        """(n,) bool, whether vectors (n, k) lie within the bounds, K3 <= 1 among them."""
        low, high = self.bounds
        patterns = self.pattern.of_patterns(vectors[:, : len(self.pattern)])
        asymmetry = np.hypot(patterns[..., COS], patterns[..., SIN])
        return ((low <= vectors) & (vectors <= high)).all(axis=1) & (asymmetry <= 1.0).all(axis=1)

    @property
    def weak_prior(self) -> Prior:
        """Prior of the vector where nothing is known of this bell."""
        of_pattern = [(c.centre, c.width) for c in self.pattern.coordinates]
        widths = [
            1.0 if e.is_shape else self.amplitude_sizes.get(e.effect, 1.0) for e in self.of_effects
        ]
        centre, width = np.array(of_pattern + [(0.0, width) for width in widths]).T
        return Prior(centre, np.diag(width))

    @cached_property
    def prior(self) -> Prior:
        """Prior of the vector: weak, but for what is known, widened by how jobs differ."""
        weak, known = self.weak_prior, self.known
        if known is None:
            return weak
        names = self.coordinates
        of_known = [k for k, name in enumerate(known.names) if name in names]
        own = [names.index(known.names[k]) for k in of_known]
        centre, covariance = weak.centre.copy(), np.diag(weak.width**2)
        scale = self.scale[own]
        centre[own] = (known.centre[of_known] - self.offset[own]) / scale
        of_effects = EFFECT_BETWEEN_JOBS**2 * np.eye(len(self.varied))
        between_jobs = block_diag(self.pattern.between_jobs, of_effects)
        covariance[np.ix_(own, own)] = (
            known.matrix[np.ix_(of_known, of_known)] / np.outer(scale, scale)
            + between_jobs[np.ix_(own, own)]
        )  # fmt: skip
        return Prior(centre, np.linalg.cholesky(covariance))

    def encode(self, model: DepositionModel) -> np.ndarray:
        """The vector of a model that has the varied effects, kept inside the bounds."""
        entries = self.pattern.encode(model.patterns)
        entries += [e.encode(getattr(model.effect(e.effect), e.name)) for e in self.of_effects]
        return np.clip(np.array(entries), *self.bounds)

    def values(self, vectors: np.ndarray) -> np.ndarray:
        """(n, k) parameters in the model's units, pattern first, for vectors (n, k)."""
        count = len(self.pattern)
        columns = zip(self.of_effects, vectors[:, count:].T, strict=True)
        amounts = [entry.decode(column) for entry, column in columns]
        return np.column_stack([self.pattern.values(vectors[:, :count]), *amounts])

    def decode(self, vector: np.ndarray) -> DepositionModel:
        """The model of a vector."""
        values = [float(value) for value in self.values(vector[np.newaxis])[0]]
        count = len(self.pattern.names)
        changed: dict[str, dict[str, float]] = {}
        for entry, value in zip(self.of_effects, values[count:], strict=True):
            changed.setdefault(entry.effect, {})[entry.name] = value
        effects = tuple(
            e.model_copy(update=changed[e.id]) if e.id in changed else e
            for e in self.start.effects
        )
        found = self.start.with_patterns(self.pattern.patterns(values[:count]))
        return found.model_copy(update={'effects': effects})
