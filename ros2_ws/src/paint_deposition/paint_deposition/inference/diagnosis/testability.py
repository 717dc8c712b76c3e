"""What the readings can show at all: effects may not, and others do from a smallest size on."""

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.inference.diagnosis.explanations import Explanation
from paint_deposition.inference.diagnosis.model_space import EffectEvidence

# An amplitude is detectable if the test that something is missing, at this level, finds it with
# this power.
LEVEL, POWER = 0.05, 0.9
# Signal-to-noise ratios at which the power is simulated, and with how many draws.
RATIOS, DRAWS = np.geomspace(2.5, 10.0, 10), 200
# Ids of effects that do not show, and detectable amplitudes of the others by id and parameter.
Testability = tuple[tuple[str, ...], dict[str, dict[str, float]]]


def testability(space: EffectEvidence, seed: int) -> Testability:
    """What these readings can show of each effect beside the model of an evidence."""
    shapes: dict[type[Effect], list[Explanation]] = {}
    for explanation in space.explanations:
        if explanation.law is not None:
            shapes.setdefault(type(explanation.law), []).append(explanation)
    draws = space.null_draws(seed)
    null, draws = space.evidence(draws), draws[:, :DRAWS]
    not_testable, detectable = [], {}
    for effect, found in shapes.items():
        most = np.abs(effect.amplitude_bounds()).max(axis=0)
        # Along the combination of amplitudes that shows most.
        seen = (space.null.whiten(s.columns * most) for s in found)
        # An effect counts as testable from this signal-to-noise ratio on, at the largest amplitude
        # that is physical and with the pattern refitted.
        if max(np.linalg.norm(columns, 2) for columns in seen) >= 2.0:
            detectable[effect.id] = _detectable(space, effect, found, null, draws)
        else:
            not_testable.append(effect.id)
    return tuple(not_testable), detectable


def _detectable(
    space: EffectEvidence,
    effect: type[Effect],
    shapes: list[Explanation],
    null: np.ndarray,
    draws: np.ndarray,
) -> dict[str, float]:
    """Smallest detectable amplitudes, for the shape that shows best, where physically possible."""
    info, found = effect.parameters(), {}
    for k, name in enumerate(effect.amplitudes()):
        columns = [space.null.whiten(s.columns[:, [k]])[:, 0] for s in shapes]
        best = max(columns, key=lambda column: float(np.linalg.norm(column)))
        strength = float(np.linalg.norm(best))
        if strength < 1e-9:
            continue
        backward = shapes[0].sides[k] < 0.0
        direction = (-best if backward else best) / strength
        power = power_along(space, direction, RATIOS, null, draws)
        if power[-1] < POWER:
            continue
        ratio = float(np.interp(POWER, np.maximum.accumulate(power), RATIOS))
        amount = ratio * info[name]['typical'] / strength
        room = max(abs(info[name][end] - info[name]['neutral']) for end in ('low', 'high'))
        if amount <= room:
            found[name] = amount
    return found


def power_along(
    space: EffectEvidence,
    direction: np.ndarray,
    ratios: np.ndarray,
    null: np.ndarray,
    draws: np.ndarray,
) -> np.ndarray:
    """(R,) probability that the test finds a deviation of each of R lengths.

    Args:
        direction: (P,) unit vector of whitened deviations. ratios: (R,) the lengths.
        null: simulated evidence if no cause acted. draws: (P, D) deviations behind its first D.
    """
    # The evidence of what takes up most of the direction; others weigh as without a deviation.
    taken = [
        float(np.sum((own.columns.T @ direction) ** 2 / (1.0 + own.squares)))
        for own in space.principal
    ]
    chosen, count = np.argsort(taken)[::-1][:6].tolist(), draws.shape[1]
    rest = np.exp(null[:count]) - np.exp(space.evidence(draws, chosen))
    along = space.evidence(draws, chosen, np.multiply.outer(direction, ratios))
    evidence = np.log(np.exp(along.reshape(len(ratios), count)) + rest)
    return np.mean(evidence > np.quantile(null, 1.0 - LEVEL), axis=1)
