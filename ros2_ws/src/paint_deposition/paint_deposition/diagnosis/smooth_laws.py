"""Smooth curves over a covariate, as changes of the readings: the film of a law of any form.

A curve is a random function with a length of correlation, given by its values at even knots. The
film that a factor 1 + h on what arrives changes is linear in these values.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.learned import LEARNED, LearnedLaw, knot_weights
from paint_deposition.fitting.study import Study
from paint_deposition.readings.covariates import Rays

KNOTS = 12
# Rays that leave less than this share of the most are left out of a covariate's range, and
# outermost rays by this share of their number.
FAINT, OUTERMOST = 0.02, 0.01
# Directions of a random function below this share of the largest variance are left out.
NEGLIGIBLE = 1e-2


@dataclass(frozen=True)
class CurveBasis:
    """Curves over one covariate.

    Attributes:
        law: what the curve becomes in a model.
        kind: 'factor' or 'addition'.
        low, high: range of the covariate in the readings, in its unit.
        film_um: (P, K) change of the film for a curve of 1 (1 um) at each knot.
        spread: standard deviation of the covariate over the points, in steps between knots.
    """

    law: type[LearnedLaw]
    kind: str
    low: float
    high: float
    film_um: np.ndarray
    spread: float

    def root(self, length: float) -> np.ndarray:
        """(K, n) square root of the covariance of random curves of unit variance.

        Args:
            length: of correlation, in standard deviations of the covariate.
        """
        knots = np.arange(self.film_um.shape[1])
        steps = max(length * self.spread, 1.0)
        values, vectors = eigh(np.exp(-0.5 * ((knots[:, np.newaxis] - knots) / steps) ** 2))
        kept = values > NEGLIGIBLE * values[-1]
        return vectors[:, kept] * np.sqrt(values[kept])

    def learned(self, values: np.ndarray) -> LearnedLaw:
        """The law with these values (K,) at the knots."""
        return self.law(
            low=self.low, high=self.high, kind=self.kind, learned=tuple(map(float, values))
        )


def curve_basis(
    study: Study, model: DepositionModel, covariate: str, kind: str = 'factor', knots: int = KNOTS
) -> CurveBasis | None:
    """The basis of curves over a covariate; None where the covariate does not vary.

    Args:
        study: the readings.
        model: whose rays and pattern say what arrives where.
        covariate: one that a learned law can have.
        kind: 'factor' on what arrives, or 'addition' to the film.
        knots: K.
    """
    law = LEARNED[covariate]
    rays, values = study.rays(model), [along[covariate] for along in study.along_rays(model)]
    low, high = _range(rays, values)
    if not law.axis(high) - law.axis(low) > 1e-9:
        return None
    films, positions = [], []
    for part, value in zip(rays, values, strict=True):
        weights = knot_weights(law, value, low, high, knots)
        if kind == 'addition':
            film = weights[0]
        elif value.shape[1] == 1:
            film = part.share.T @ weights[:, 0]
        else:
            film = np.einsum(
                'mp,mpk->pk', part.share, np.broadcast_to(weights, (*part.share.shape, knots))
            )
        films.append(film)
        positions.append(part.mean(law.axis(value)))
    step = (law.axis(high) - law.axis(low)) / (knots - 1)
    return CurveBasis(
        law, kind, low, high, np.vstack(films), float(np.std(np.concatenate(positions)) / step)
    )


def _range(rays: list[Rays], values: list[np.ndarray]) -> tuple[float, float]:
    """Least and greatest value of a covariate at which film arrives."""
    lows, highs = [], []
    for part, value in zip(rays, values, strict=True):
        if value.shape == part.share.shape:
            value = value[part.share > FAINT * part.share.max()]
            lows.append(np.quantile(value, OUTERMOST))
            highs.append(np.quantile(value, 1.0 - OUTERMOST))
        else:
            lows.append(value.min())
            highs.append(value.max())
    return float(min(lows)), float(max(highs))
