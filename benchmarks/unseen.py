"""Errors on readings that no diagnosis has seen, over their noise.

An error is the root mean square that fresh readings would have, over that of their noise: the
model's error is taken where the shop knows the film, and the noise's variance is added to it. The
level of each part and the zero of its gauge session are those that the readings show.
"""

import numpy as np
from benchmarks.campaigns import Draw, PaintedCase
from benchmarks.rivals import Points, shown_amounts

from paint_deposition.effects.deposition_model import DepositionModel

# A hidden effect may be this many times as strong as it is: the oracle does not know how strong.
UNKNOWN_AMOUNT = 10.0


def unseen_error(
    painted: PaintedCase, draw: Draw, points: Points, model: DepositionModel
) -> float:
    """Error of a model on the unseen readings of a draw, 1 where only noise is left."""
    rows = points.kept
    rest = (points.mean_um - painted.forward.predict_um(model))[rows]
    shown, _ = shown_amounts(points.level_um[rows], rest, points.sigma_um[rows])
    true = np.concatenate([
        films.film_um * session.level + films.expected_um - films.film_um + session.offset_um
        for films, session in zip(painted.unseen, draw.sessions, strict=True)
    ])  # fmt: skip
    error = true - unseen_levels_um(painted) @ shown - painted.unseen_forward.predict_um(model)
    return over_noise(error**2, unseen_sigma_um(painted))


def oracle_unseen_error(painted: PaintedCase, points: Points) -> float:
    """Expected error of who knows the pattern's form and the mark of what is hidden.

    It has to find the pattern, the levels and the amounts from the same readings.
    """
    hidden = UNKNOWN_AMOUNT * np.concatenate([films.marks_um for films in painted.unseen])
    seen = [points.level_um, painted.pattern_um, UNKNOWN_AMOUNT * points.marks_um]
    unseen = np.hstack([unseen_levels_um(painted), painted.unseen_pattern_um, hidden])
    rows = points.kept
    columns = np.hstack(seen)[rows]
    _, covariance = shown_amounts(columns, np.zeros(len(columns)), points.sigma_um[rows])
    variance = np.einsum('pi,ij,pj->p', unseen, covariance, unseen)
    return over_noise(variance, unseen_sigma_um(painted))


def over_noise(squared_um: np.ndarray, sigma_um: np.ndarray) -> float:
    """Root mean square of errors and noise together, over that of the noise."""
    return float(np.sqrt(1.0 + np.mean(squared_um) / np.mean(sigma_um**2)))


def unseen_sigma_um(painted: PaintedCase) -> np.ndarray:
    """Noise of single unseen readings: gauge and texture [um]."""
    noise = painted.case.noise
    return np.concatenate([
        np.hypot(noise.sigma_um(films.expected_um), noise.texture * films.film_um)
        for films in painted.unseen
    ])  # fmt: skip


def unseen_levels_um(painted: PaintedCase) -> np.ndarray:
    """Change of the unseen readings with each part's level and zero, in the order of Points."""
    noise = painted.case.noise
    part = np.repeat(np.arange(len(painted.unseen)), [len(f.film_um) for f in painted.unseen])
    own = part[:, np.newaxis] == np.arange(len(painted.unseen))
    film = np.concatenate([films.film_um for films in painted.unseen])
    return np.hstack([own * noise.level * film[:, np.newaxis], own * noise.session_offset_um])
