"""Smooth laws of any form, as changes of the readings that are linear in the laws' values.

A law is a random function with a length of correlation, given by its values at knots: a curve over
a covariate, a map over a part, or a deviation of the footprint.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.learned_curves import CURVES, LearnedCurve, knot_positions
from paint_deposition.effects.learned_laws import (
    WAVES,
    LearnedFootprint,
    LearnedLaw,
    LearnedMap,
    PartGrid,
    hat_sums,
    hat_weights,
    places_m,
    waves,
)
from paint_deposition.inference.fitting.least_squares import STEP, Fit
from paint_deposition.inference.fitting.random_effects import root_of_field, smooth, with_edges
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.covariates import Rays
from paint_deposition.model.eq1_pattern import PlanarPattern

# Knots of a curve; time is resolved more finely, as pumps pulsate.
KNOTS, TIME_KNOTS = 12, 40
# Directions of a random function below this share of the largest variance are left out.
NEGLIGIBLE = 1e-2
# Distance between the knots of a map [m], and number of them along the radius of a footprint.
MAP_STEP_M, RADII = 0.06, 10
# Angles at which a pattern is averaged.
ANGLES = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
# Distance of knots that have nothing in common.
APART = 1e6


@dataclass(frozen=True)
class Basis:
    """Laws over one covariate, by their values at K knots."""

    law: type[LearnedLaw]  # what the values become in a model
    settings: Mapping[str, Any]  # what the law needs besides them
    film_um: np.ndarray  # (P, K) change of the film for a value of 1 (1 um) at each knot
    knots: np.ndarray  # (K, D) their places, in the unit in which lengths of correlation are given
    shortest: float  # length that the knots resolve, in that unit
    edges: bool = False  # whether the law may change within less than its length of correlation

    def random(self, size: float, length: float) -> 'RandomLaw':
        """Random laws.

        Args:
            size: standard deviation of the values.
            length: of correlation.
        """
        correlation = with_edges if self.edges else smooth
        root = size * root_of_field(
            self.knots, max(length, self.shortest), NEGLIGIBLE, correlation
        )
        return RandomLaw(self, root)

    def centred(self, values: np.ndarray) -> np.ndarray:
        """(K, n) values less their mean over all film, so that its whole stays as it is."""
        film_um = self.film_um.sum(axis=0)
        return values - film_um @ values / film_um.sum()


@dataclass(frozen=True)
class RandomLaw:
    """A law that is a random function."""

    basis: Basis  # its values at knots
    at_knots: np.ndarray  # (K, n) those values for n independent amplitudes of unit variance

    @property
    def change_um(self) -> np.ndarray:
        """(P, n) change of the film for each amplitude of one."""
        return self.basis.film_um @ self.at_knots

    @property
    def centred(self) -> 'RandomLaw':
        """Random laws of this form, each leaving the film as a whole as it is."""
        return RandomLaw(self.basis, self.basis.centred(self.at_knots))

    def around(self, study: Study, model: DepositionModel) -> 'RandomLaw':
        """The random law where another model says what arrives where."""
        settings = self.basis.settings
        kind, needs = settings.get('kind', ''), settings.get('acts_with', '')
        bases, maps = bases_over(study, model, self.basis.law, kind, needs), settings.get('maps')
        (basis,) = (basis for basis in bases if basis.settings.get('maps') == maps)
        return replace(self, basis=basis)

    def learned(self, amplitudes: np.ndarray, covariance: np.ndarray | None = None) -> LearnedLaw:
        """The law with these amplitudes (n,); a curve also tells how well they are known.

        Args:
            amplitudes: their posterior mean. covariance: (n, n), or None if it is not known.
        """
        values = tuple(map(float, self.at_knots @ amplitudes))
        settings = dict(self.basis.settings)
        if covariance is not None and issubclass(self.basis.law, LearnedCurve):
            settings['sd'] = tuple(map(float, self.sd(covariance)))
        return self.basis.law(**settings, learned=values)

    def sd(self, covariance: np.ndarray) -> np.ndarray:
        """(K,) standard deviations of the values, for a covariance (n, n) of the amplitudes.

        For a factor, those of its deviation from the mean over all film: a factor on all film
        alike is the pattern's.
        """
        root = self.at_knots
        if self.basis.settings.get('kind') == 'factor':
            root = self.basis.centred(root)
        return np.sqrt(np.einsum('kn,nm,km->k', root, covariance, root))


def bases_over(
    study: Study, model: DepositionModel, law: type[LearnedLaw], kind: str, needs: str = ''
) -> list[Basis]:
    """Laws over any covariate; none where it does not vary."""
    if law is LearnedFootprint:
        return [footprint_basis(study, model)]
    if law is LearnedMap:
        return map_bases(study, model, kind)
    basis = curve_basis(study, model, law.covariate, kind, needs)
    return [basis] if basis else []


def curve_basis(
    study: Study, model: DepositionModel, covariate: str, kind: str = 'factor', needs: str = ''
) -> Basis | None:
    """Curves over a covariate; None where it does not vary.

    Lengths of correlation are in standard deviations of the covariate over the points.

    Args:
        model: whose rays and pattern say what arrives where.
        covariate: one that a learned curve can have.
        kind: 'factor' on what arrives, or 'addition' to the film.
        needs: of the cell; on parts where this was switched off the curves do not act.
    """
    law = CURVES[covariate]
    knots = TIME_KNOTS if covariate == 'time_s' else KNOTS
    rays = study.rays(model)
    values = [part.along[covariate] for part in rays]
    low, high = _range(rays, values)
    if not law.axis(high) - law.axis(low) > 1e-9:
        return None
    films, positions = [], []
    for part, value in zip(rays, values, strict=True):
        at = knot_positions(law, value, low, high, knots)
        if kind == 'addition':
            films.append(hat_weights(at[0], knots))
        elif value.shape[1] == 1:
            films.append(part.share.T @ hat_weights(at[:, 0], knots))
        else:
            films.append(hat_sums(part.share, at, knots))
        positions.append(part.mean(law.axis(value)))
    step = (law.axis(high) - law.axis(low)) / (knots - 1)
    step /= max(float(np.std(np.concatenate(positions))), 1e-9)
    places = step * np.arange(knots)[:, np.newaxis]
    settings = {'kind': kind, 'low': low, 'high': high, 'acts_with': needs}
    change = study.has(needs)[:, np.newaxis] * np.vstack(films)
    return Basis(law, settings, change, places, step)


def map_bases(study: Study, model: DepositionModel, kind: str = 'factor') -> list[Basis]:
    """A map over each part that was measured, and one over all; lengths in metres.

    Parts of one shape share a map, however they were painted.
    """
    film_um = study.forward.predict_um(model)
    owner, experiments = study.campaign.experiment_of, study.campaign.experiments
    points = [experiment.measured_points for experiment in experiments]
    sides = [tuple(map(float, np.round(p.extent_m, 3))) for p in points]
    grids: list[PartGrid] = []
    changes, knots = [], []
    for side in dict.fromkeys(sides):
        places = {k: places_m(points[k]) for k, other in enumerate(sides) if other == side}
        everywhere = np.vstack(list(places.values()))
        low, high = everywhere.min(axis=0), everywhere.max(axis=0)
        if min(high - low) < MAP_STEP_M:
            continue
        columns, rows = (int(n) for n in np.ceil((high - low) / MAP_STEP_M) + 1)
        grid = PartGrid(
            part_m=side, low_m=tuple(low.tolist()), high_m=tuple(high.tolist()),
            columns=columns, rows=rows,
        )  # fmt: skip
        change = np.zeros((len(study), grid.knots))
        for k, place_m in places.items():
            change[owner == k] = grid.weights(place_m)
        # Parts have nothing in common.
        knots.append(np.column_stack([grid.knots_m(), np.full(grid.knots, APART * len(grids))]))
        changes.append(change * film_um[:, np.newaxis] if kind == 'factor' else change)
        grids.append(grid)
    chosen = [[k] for k in range(len(grids))] + [list(range(len(grids)))] * (len(grids) > 1)
    return [
        Basis(
            LearnedMap,
            {'kind': kind, 'maps': tuple(grids[k] for k in parts)},
            np.hstack([changes[k] for k in parts]),
            np.vstack([knots[k] for k in parts]),
            MAP_STEP_M,
            edges=True,
        )
        for parts in chosen
    ]


def footprint_basis(study: Study, model: DepositionModel, radii: int = RADII) -> Basis:
    """Deviations of the pattern from eq. (1), lengths of correlation in steps of the radius.

    Each harmonic of the angle is a random function of the radius by itself, the same for all
    brushes.

    Args:
        model: its patterns and projection.
        radii: how many knots from the middle to the end of the pattern.
    """
    patterns = model.patterns
    # The pattern ends at this many of its widths beyond the ring.
    reach = max(p.r_m + 3.0 * max(p.sigma1_m, p.sigma2_m) for p in patterns)
    films = []
    for rays in study.rays(model):
        radius = np.hypot(rays.x_m, rays.y_m) / reach * (radii - 1)
        angle = waves(rays.x_m, rays.y_m)
        films.append(np.stack([hat_sums(rays.share * wave, radius, radii) for wave in angle]))
    film_um = np.concatenate(films, axis=1)  # WAVES, P, radii
    radius, wave = np.indices((radii, WAVES))
    places = np.column_stack([radius.ravel(), APART * wave.ravel()]).astype(float)
    change = film_um.transpose(1, 2, 0).reshape(film_um.shape[1], -1)
    return Basis(LearnedFootprint, {'reach_m': float(reach)}, change, places, 1.0)


def flux_around(pattern: PlanarPattern, reach_m: float, radii: int) -> np.ndarray:
    """(angles, radii) flux of a pattern [um/s], from its middle to this distance."""
    radius, angle = np.linspace(0.0, reach_m, radii), ANGLES[:, np.newaxis]
    return pattern.flux_um_per_s(radius * np.cos(angle), radius * np.sin(angle))


def beside_pattern(
    basis: Basis, at_knots: np.ndarray, pattern: np.ndarray, study: Study, fit: Fit
) -> tuple[np.ndarray, np.ndarray]:
    """What is left of deviations of a footprint when the pattern has followed them.

    A pattern that stays where it fits best is needed for this (Plumlee 2017): otherwise footprint
    and pattern are free to go far away together.

    Args:
        basis: of footprints. at_knots: (K, n) deviations.
        pattern: (P, k) change of the readings by the pattern's entries, over the noise.
        fit: of the pattern.

    Returns:
        (K, n) the deviations, and (k, n) by how much the pattern's entries follow each.
    """
    radii, reach_m = len(basis.knots) // WAVES, basis.settings['reach_m']
    harmonics = waves(np.cos(ANGLES), np.sin(ANGLES)) / len(ANGLES)
    harmonics[1:] *= 2.0

    def log_flux(vector: np.ndarray) -> np.ndarray:
        patterns = fit.parameters.decode(vector).patterns
        around = [np.log(flux_around(p, reach_m, radii) + 1e-12) for p in patterns]
        return (harmonics @ np.mean(around, axis=0)).T.ravel()

    here, count = log_flux(fit.vector), len(fit.parameters.pattern)
    # Away from an upper bound: beyond it there is no pattern.
    steps = np.where(fit.vector + STEP > fit.parameters.bounds[1], -STEP, STEP)
    moved = fit.vector + np.diag(steps)
    relative = np.stack([(log_flux(moved[k]) - here) / steps[k] for k in range(count)], axis=1)
    change = basis.film_um @ at_knots / study.sigma_um[:, np.newaxis]
    # A pattern that hardly shows, by this share of its largest change, would go anywhere.
    scale = fit.parameters.prior.factor[:count, :count]
    slopes = pattern @ scale
    followed = scale @ np.linalg.lstsq(slopes, change, rcond=1e-4)[0]
    return at_knots - relative @ followed, followed


def _range(rays: list[Rays], values: list[np.ndarray]) -> tuple[float, float]:
    """Least and greatest value of a covariate at which film arrives."""
    lows, highs = [], []
    for part, value in zip(rays, values, strict=True):
        if value.shape == part.share.shape:
            # Rays that leave less than this share of the most are left out, and one of a hundred
            # on either side.
            value = value[part.share > 0.02 * part.share.max()]
            lows.append(np.quantile(value, 0.01))
            highs.append(np.quantile(value, 0.99))
        else:
            lows.append(value.min())
            highs.append(value.max())
    return float(min(lows)), float(max(highs))
