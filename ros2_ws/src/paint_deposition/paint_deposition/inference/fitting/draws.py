"""Models drawn from what a fit knows: equally likely ones."""

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.learned.curves import LearnedCurve
from paint_deposition.errors import ModelError
from paint_deposition.inference.fitting.parameters import FreeParameters
from paint_deposition.inference.posterior import Posterior

# Values of a learned curve so many knots apart are hardly off together.
KNOTS_TOGETHER = 2.0
# A posterior of which less than one draw in so many is physical belongs to another model.
MOST_ROUNDS = 1000


def drawn(
    model: DepositionModel, posterior: Posterior, count: int, seed: int
) -> list[DepositionModel]:
    """So many models from the posterior of a model, the normal distribution within its bounds.

    Draws with a value outside its bounds are drawn anew: none is unphysical, and none piles up at
    a bound. Learned curves vary within their band, by themselves.

    Args:
        model: that the posterior belongs to; it has every effect that the posterior names.

    Raises:
        ModelError: next to no draw lies within the bounds.
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
    rng = np.random.default_rng(seed)
    vectors = np.empty((0, len(order)))
    for _ in range(MOST_ROUNDS):
        values = rng.multivariate_normal(
            posterior.centre[order], covariance, count, method='cholesky'
        )
        fresh = (values - parameters.offset) / parameters.scale
        vectors = np.concatenate([vectors, fresh[parameters.are_physical(fresh)]])
        if len(vectors) >= count:
            break
    else:
        raise ModelError(
            f'posterior: of {MOST_ROUNDS * count} draws {len(vectors)} are within the bounds of '
            'the parameters; copy the section from the file that was written for this model'
        )
    models = [parameters.decode(vector) for vector in vectors[:count]]
    return [
        one.model_copy(update={'effects': tuple(_bent(effect, rng) for effect in one.effects)})
        for one in models
    ]


def _bent(effect: Effect, rng: np.random.Generator) -> Effect:
    """A learned curve drawn from its band; any other effect as it is."""
    if not (isinstance(effect, LearnedCurve) and effect.sd):
        return effect
    knots = np.arange(len(effect.sd))
    apart = np.subtract.outer(knots, knots) / KNOTS_TOGETHER
    covariance = np.exp(-0.5 * apart**2) * np.outer(effect.sd, effect.sd)
    learned = rng.multivariate_normal(effect.learned, covariance, method='eigh')
    return effect.model_copy(update={'learned': tuple(learned.tolist())})
