"""What a fit knows of a model's parameters, as a section of the model file."""

from collections.abc import Sequence
from itertools import zip_longest
from typing import Annotated

import numpy as np
from pydantic import BaseModel, Field, model_validator

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ModelError, did_you_mean
from paint_deposition.model.eq1_pattern import PATTERN

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
