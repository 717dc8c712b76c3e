"""Rivals of the diagnosis: an oracle that knows the mark, and stepwise selection by BIC."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from benchmarks.campaigns import Draw, PaintedCase
from scipy.linalg import cholesky, solve_triangular
from scipy.stats import chi2

from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.inference.diagnosis.sensitivities import neutral_shapes, sensitivity
from paint_deposition.inference.diagnosis.verdict import Diagnosis
from paint_deposition.inference.fitting.least_squares import covariance_factor, fit_readings
from paint_deposition.inference.fitting.parameters import FreeParameters

MOST_CHOSEN = 3
STARTS = 4


@dataclass(frozen=True)
class Points:
    """The point means of a draw with all that the shop knows of them; mistyped readings left out.

    Attributes:
        mean_um, film_um, expected_um, clean_um: (P,) [um].
        marks_um: (P, hidden) what each hidden effect alone changes [um].
        sigma_um: (P,) true standard deviation of the means: gauge and texture [um].
        level_um: (P, 2 E) change with each part's level and each session's zero, in their
            standard deviations [um].
        kept: (P,) False where all readings of a point were mistyped.
    """

    mean_um: np.ndarray
    film_um: np.ndarray
    expected_um: np.ndarray
    clean_um: np.ndarray
    marks_um: np.ndarray
    sigma_um: np.ndarray
    level_um: np.ndarray
    kept: np.ndarray

    @staticmethod
    def of(painted: PaintedCase, draw: Draw) -> 'Points':
        noise, parts = painted.case.noise, len(painted.films)
        rows = []
        for k, (films, session, experiment) in enumerate(
            zip(painted.films, draw.sessions, draw.campaign.experiments, strict=True)
        ):
            means, right = experiment.means, ~session.slipped
            count = np.bincount(means.owner, right, minlength=len(means.first))
            total = np.bincount(
                means.owner, right * session.thickness_um, minlength=len(means.first)
            )
            film = films.film_um[means.first]
            gauge = noise.sigma_um(films.expected_um[means.first]) / np.sqrt(np.maximum(count, 1))
            level = np.zeros((len(film), 2 * parts))
            level[:, k], level[:, parts + k] = noise.level * film, noise.session_offset_um
            rows.append((
                total / np.maximum(count, 1),
                film,
                films.expected_um[means.first],
                films.clean_um[means.first],
                films.marks_um[means.first],
                np.hypot(gauge, noise.texture * film),
                level,
                count > 0,
            ))  # fmt: skip
        return Points(*(np.concatenate(columns) for columns in zip(*rows, strict=True)))


def shown_amounts(
    columns: np.ndarray, deviation_um: np.ndarray, sigma_um: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Best linear prediction of standard normal amounts and its covariance.

    Args:
        columns: (P, n) change of the readings with each amount [um].
        deviation_um, sigma_um: (P,) of the readings [um].
    """
    weighted = columns / sigma_um[:, np.newaxis] ** 2
    covariance = np.linalg.inv(np.eye(columns.shape[1]) + weighted.T @ columns)
    return covariance @ (weighted.T @ deviation_um), covariance


@dataclass(frozen=True)
class Oracle:
    """Knows the noise, the pattern to within its prior, and how marks look; not how strong.

    Attributes:
        lower: (P, P) Cholesky factor of what it does not know: noise, levels, pattern.
    """

    lower: np.ndarray

    @staticmethod
    def of(sigma_um: np.ndarray, *directions: np.ndarray) -> 'Oracle':
        """From the noise (P,) and directions (P, n) along which readings may deviate [um]."""
        columns = np.hstack(directions)
        covariance = np.diag(sigma_um**2) + columns @ columns.T
        return Oracle(cholesky(covariance, lower=True))

    def strength(self, mark_um: np.ndarray) -> float:
        """Size of a small mark (P,) in standard deviations, the pattern refitted around it."""
        return float(np.linalg.norm(solve_triangular(self.lower, mark_um, lower=True)))

    def p_value(self, deviation_um: np.ndarray, mark_um: np.ndarray) -> float:
        """Likelihood-ratio test of a mark of unknown amplitude against none."""
        mark = solve_triangular(self.lower, mark_um, lower=True)
        deviation = solve_triangular(self.lower, deviation_um, lower=True)
        length = mark @ mark
        return float(chi2.sf((mark @ deviation) ** 2 / length, 1)) if length > 0.0 else 1.0


def visible_strength(painted: PaintedCase, points: Points, mark_um: np.ndarray) -> float:
    """Size of any mark (P,) in standard deviations: what the best pattern leaves of it.

    Patterns have bounds, so that a great mark is more visible than where the pattern is linear.
    """
    sigma_um = points.sigma_um
    films_um = painted.forward.predict_um(painted.pattern) + mark_um
    nuisance = points.level_um / sigma_um[:, np.newaxis]
    start = FreeParameters.of(painted.pattern)
    fit = fit_readings(painted.forward, films_um, sigma_um, start, STARTS, 0, nuisance)
    return float(np.sqrt(fit.marginal.chi_square))


def stepwise_bic(diagnosis: Diagnosis) -> list[str]:
    """Forward selection by BIC over the marks of the library: the usual way."""
    study, fit = diagnosis.study, diagnosis.history[0].fit
    lower = covariance_factor(fit.nuisance)
    marks = [
        (effect.id, sensitivity(study.forward, fit, shape, study.sigma_um).columns)
        for effect in EFFECTS.values()
        for shape in neutral_shapes(effect)
    ]
    whitened = [(key, solve_triangular(lower, columns, lower=True)) for key, columns in marks]
    return chosen_by_bic(fit.marginal.jacobian, fit.marginal.residual, whitened)


def chosen_by_bic(
    columns: np.ndarray, readings: np.ndarray, marks: Sequence[tuple[str, np.ndarray]]
) -> list[str]:
    """Ids in the order chosen, each at most once.

    Args:
        columns: (P, k) what is fitted anyway, over the noise.
        readings: (P,) over the noise.
        marks: id and directions (P, n) of each candidate; an id may have several.
    """

    def bic(design: np.ndarray) -> float:
        solved, *_ = np.linalg.lstsq(design, readings, rcond=None)
        rest = readings - design @ solved
        return float(rest @ rest) + design.shape[1] * np.log(len(readings))

    chosen: list[str] = []
    value = bic(columns)
    while len(chosen) < MOST_CHOSEN:
        options = [
            (bic(np.hstack([columns, more])), k)
            for k, (key, more) in enumerate(marks)
            if key not in chosen
        ]
        best, k = min(options)
        if best >= value:
            break
        value, columns = best, np.hstack([columns, marks[k][1]])
        chosen.append(marks[k][0])
    return chosen
