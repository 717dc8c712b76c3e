"""Models drawn from what a fit knows: equally likely ones."""

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.files.posterior import Posterior
from paint_deposition.fitting.parameters import FreeParameters


def drawn(
    model: DepositionModel, posterior: Posterior, count: int, seed: int
) -> list[DepositionModel]:
    """So many models from the posterior of a model, values outside their bounds kept at them.

    Args:
        model: that the posterior belongs to; it has every effect that the posterior names.
    """
    varied = [
        (effect.id, name)
        for effect in model.effects
        for name, coordinate in effect.coordinates().items()
        if f'{effect.id}.{coordinate}' in posterior.names
    ]
    parameters = FreeParameters(model, tuple(varied))
    order = [posterior.names.index(name) for name in parameters.coordinates]
    covariance = posterior.matrix[np.ix_(order, order)]
    values = np.random.default_rng(seed).multivariate_normal(
        posterior.centre[order], covariance, count, method='cholesky'
    )
    vectors = (values - parameters.offset) / parameters.scale
    return [parameters.decode(vector) for vector in np.clip(vectors, *parameters.bounds)]
