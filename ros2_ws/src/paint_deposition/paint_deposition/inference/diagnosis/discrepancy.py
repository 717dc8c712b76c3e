"""The discrepancy: smooth errors of every part that no law explains and no gauge made.

Sprays of one setting differ from each other, alike in neighbouring places, and their shape changes
with the setting in more ways than any law says. Each part therefore has a smooth error of its own,
shared by parts that were painted alike as far as it is the setting's, and the footprint deviates
from the two Gaussians of eq. (1) on all parts alike. Their sizes and lengths are not known: they
are hyperparameters with a prior from measured sprays, over which every evidence is averaged.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from types import SimpleNamespace

import numpy as np
from scipy.spatial.distance import cdist

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.learned_laws import HARMONICS, WAVES
from paint_deposition.inference.diagnosis.smooth_laws import (
    RandomLaw,
    beside_pattern,
    flux_around,
    footprint_basis,
)
from paint_deposition.inference.fitting.forward import derivatives_by_pattern
from paint_deposition.inference.fitting.least_squares import Fit
from paint_deposition.inference.fitting.random_effects import smooth
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.campaign import Experiment
from paint_deposition.model.eq1_pattern import PlanarPattern

# What is believed of the discrepancy before the readings. The sources are sprays of two flat-fan
# nozzles at three heights, each measured several times (sprays of one setting differ by 0.5 to 5 %
# of the peak, a third as much where the film is a twentieth of it), and 40 panels of clearcoat.
# Shares are standard deviations.
PRIOR = SimpleNamespace(
    # Shares of its peak by which the footprint may deviate at any place. What a footprint explains
    # as well is not taken for an effect; the readings tell which share it is.
    footprints=(0.02, 0.06, 0.2),
    # The same for the difference between its two sides: 0.5 to 2 % were measured.
    sides=0.02,
    # Power of the Gaussians' exponents in the tails: off from 1 by so much.
    tails=0.5,
    # Most of itself by which the flux is off.
    most_of_flux=1.0,
    # Sizes of fields, as shares of the part's thickest film, and the prior of each: its median,
    # and the factor that is one standard deviation. They fall with the root of the film.
    settings=(0.006, 0.02, 0.06),
    usual_setting=(0.02, 2.0),
    parts=(0.003, 0.01, 0.03),
    usual_part=(0.012, 2.0),
    # Most by which usual sprays differ, and what no nature does: something unknown.
    most_usual=0.02,
    beyond_nature=0.15,
    # Lengths of correlation: of fields in root mean square radii of the pattern, of the footprint
    # in shares of its radius; a fan ends sharply.
    lengths=(0.1, 0.2, 0.6),
    footprint_lengths=(0.1, 0.3),
    # Factor by which the size of a bell's footprint's deviations differs between jobs.
    footprint_between_jobs=1.5,
)
# Knots along the radius of a footprint.
FINE_RADII = 20


@dataclass(frozen=True)
class DiscrepancyHyperparameters:
    """One choice of the hyperparameters."""

    # Shares of the thickest film; the latter 0 where no parts were painted alike.
    setting: float
    part: float
    # Numbers among the lengths and footprints of the prior.
    length: int
    footprint: int
    log_prior: float  # of this choice, among those of nature or among those beyond it

    @property
    def is_beyond_nature(self) -> bool:
        """Whether so much can only be something unknown."""
        return self.setting >= PRIOR.beyond_nature


@dataclass(frozen=True)
class Footprints:
    """Deviations of the footprint, which all parts share, for amplitudes of unit variance."""

    columns: tuple[np.ndarray, ...]  # for each size (P, n), of the readings over the noise
    laws: tuple[RandomLaw, ...]  # for each, as shares of the flux at K knots
    # (radii,) distance of the knots, and the mean flux there over the peak's.
    radius_m: np.ndarray
    flux: np.ndarray

    @cached_property
    def covariances(self) -> tuple[np.ndarray, ...]:
        """For each size (P, P), of the readings over the noise."""
        return tuple(columns @ columns.T for columns in self.columns)

    @cached_property
    def of_peak(self) -> tuple[np.ndarray, ...]:
        """For each size (K, n), at the knots, as shares of the peak."""
        flux = np.repeat(self.flux, WAVES)[:, np.newaxis]
        return tuple(flux * law.at_knots for law in self.laws)

    @staticmethod
    def of(study: Study, fit: Fit, radii: int = FINE_RADII) -> 'Footprints':
        """What is left of them when the pattern has followed.

        The tails are kept as they are: the pattern follows them far from where it was fitted.
        """
        basis = footprint_basis(study, fit.model, radii)
        reach_m = basis.settings['reach_m']
        flux, tails = _flux_and_tails(fit.model.patterns, reach_m, radii)
        at_knots = np.repeat(flux, WAVES)[:, np.newaxis]
        fields = np.hstack([
            basis.random(len(PRIOR.footprint_lengths) ** -0.5, length * radii).at_knots
            for length in PRIOR.footprint_lengths
        ])  # fmt: skip
        of_film = basis.film_um / study.sigma_um[:, np.newaxis]
        # Both are of the flux alone: effects would bend the one and not the other.
        bare = fit.parameters.pattern.jacobian(fit.vector[: len(fit.parameters.pattern)])
        readings_of = study.forward.of_weights(fit.model.model_copy(update={'effects': ()}))
        _, by_pattern = derivatives_by_pattern(readings_of, fit.model.patterns)
        pattern = by_pattern @ bare / study.sigma_um[:, np.newaxis]
        columns, laws = [], []
        for size in PRIOR.footprints:
            of_wave = np.where(HARMONICS % 2, min(size, PRIOR.sides), size)
            off = np.tile(of_wave, radii)[:, np.newaxis]
            free = np.minimum(off / at_knots, PRIOR.most_of_flux) * fields
            beside, followed = beside_pattern(basis, free, pattern, study, fit)
            change = of_film @ free - pattern @ followed
            columns.append(np.hstack([of_film @ (PRIOR.tails * tails), change]))
            laws.append(RandomLaw(basis, np.hstack([PRIOR.tails * tails, beside])))
        radius_m = np.linspace(0.0, reach_m, radii)
        return Footprints(tuple(columns), tuple(laws), radius_m, flux)


@dataclass(frozen=True)
class ModelDiscrepancy:
    """The discrepancy at P points, over the noise."""

    model: DepositionModel  # around which it is taken
    footprint: Footprints  # deviations that all parts share
    # For each length (P, P), covariances of fields of size one over parts painted alike together,
    # and over each by itself; of the latter only where parts were painted alike.
    settings: tuple[np.ndarray, ...]
    parts: tuple[np.ndarray, ...]
    is_repeated: bool  # whether any were
    lengths_m: tuple[float, ...]  # of these fields [m]
    # What an earlier job says of the size of the footprint's deviations, see ``Posterior``.
    known_footprint: tuple[float, float] | None = None

    @staticmethod
    def of(study: Study, fit: Fit) -> 'ModelDiscrepancy':
        """Around a fit."""
        model, campaign, known = fit.model, study.campaign, fit.parameters.known
        owner = campaign.experiment_of
        film = np.maximum(study.forward.predict_um(model), 0.0)
        thickest = np.array([film[owner == k].max() for k in range(len(campaign.experiments))])
        scale = np.sqrt(film * thickest[owner]) / study.sigma_um
        group = painted_alike(campaign.experiments)
        repeated = (np.bincount(group)[group] > 1)[owner]
        width_m = _width_m(model)
        lengths_m = tuple(length * width_m for length in PRIOR.lengths)

        def field(of: np.ndarray, size: np.ndarray, length_m: float) -> np.ndarray:
            # Parts that are this far from each other share no field [m].
            places = np.column_stack([campaign.positions_m, 1e6 * of])
            return np.outer(size, size) * smooth(cdist(places, places) / length_m)

        return ModelDiscrepancy(
            model,
            Footprints.of(study, fit),
            tuple(field(group[owner], scale, length_m) for length_m in lengths_m),
            tuple(field(owner, scale * repeated, length_m) for length_m in lengths_m),
            bool(repeated.any()),
            lengths_m,
            known.footprint if known else None,
        )

    def select(self, rows: np.ndarray) -> 'ModelDiscrepancy':
        """The discrepancy at some of the points."""
        both, columns = np.ix_(rows, rows), (each[rows] for each in self.footprint.columns)
        return replace(
            self,
            footprint=replace(self.footprint, columns=tuple(columns)),
            settings=tuple(field[both] for field in self.settings),
            parts=tuple(field[both] for field in self.parts),
        )

    def choices(self) -> list[DiscrepancyHyperparameters]:
        """All choices of the hyperparameters; the prior of those of nature sums to one."""
        settings = {size: _log_prior(size, *PRIOR.usual_setting) for size in PRIOR.settings}
        settings[PRIOR.beyond_nature] = 0.0
        parts = {0.0: 0.0}
        if self.is_repeated:
            parts = {size: _log_prior(size, *PRIOR.usual_part) for size in PRIOR.parts}
        footprints = [0.0] * len(PRIOR.footprints)
        if self.known_footprint:
            size, factor = self.known_footprint
            jobs = np.log(PRIOR.footprint_between_jobs)
            widened = float(np.exp(np.hypot(np.log(factor), jobs)))
            footprints = [_log_prior(one, size, widened) for one in PRIOR.footprints]
        found = [
            DiscrepancyHyperparameters(setting, part, length, k, of_setting + of_part + of_print)
            for (setting, of_setting), (part, of_part), length, (k, of_print) in product(
                settings.items(), parts.items(), range(len(PRIOR.lengths)), enumerate(footprints)
            )
        ]
        total = {
            beyond: np.logaddexp.reduce(
                [s.log_prior for s in found if s.is_beyond_nature == beyond]
            )
            for beyond in (False, True)
        }
        return [
            replace(s, log_prior=s.log_prior - float(total[s.is_beyond_nature])) for s in found
        ]

    def usual(self, sizes: DiscrepancyHyperparameters) -> DiscrepancyHyperparameters:
        """Hyperparameters with settings and parts that differ by the most that usual sprays do."""
        return replace(
            sizes, setting=PRIOR.most_usual, part=PRIOR.most_usual if sizes.part else 0.0
        )

    def covariance(self, sizes: DiscrepancyHyperparameters) -> np.ndarray:
        """(P, P) covariance of all that is left over."""
        return self.of_footprint(sizes) + self.of_parts(sizes)

    def of_footprint(self, sizes: DiscrepancyHyperparameters) -> np.ndarray:
        """(P, P) that of the footprint, which all parts share."""
        return self.footprint.covariances[sizes.footprint]

    def of_parts(self, sizes: DiscrepancyHyperparameters) -> np.ndarray:
        """(P, P) that of settings and of parts."""
        k = sizes.length
        of_settings = sizes.setting**2 * self.settings[k]
        return of_settings + sizes.part**2 * self.parts[k] if sizes.part else of_settings


def _log_prior(value: float, usual: float, factor: float) -> float:
    return float(-0.5 * (np.log(value / usual) / np.log(factor)) ** 2)


def _flux_and_tails(
    patterns: Sequence[PlanarPattern], reach_m: float, radii: int
) -> tuple[np.ndarray, np.ndarray]:
    """Mean flux (radii,) of a footprint over the peak's, and its changes (K, 2) at K knots.

    The latter are relative, as the tails of ring and centre become shorter or longer: a Gaussian
    exp(-u) becomes exp(-u^p), and its derivative by the power p is -u log u of itself.
    """
    radius = np.linspace(0.0, reach_m, radii)
    flux, tails = np.zeros(radii), np.zeros((radii, 2))
    for p in patterns:
        flux += flux_around(p, reach_m, radii).mean(axis=0) / p.peak_flux_um_per_s / len(patterns)
        ring, centre = (1.0 - p.K2) * p.g1(radius, 0.0), p.K2 * p.g2(radius, 0.0)
        u = np.stack([
            (radius - p.r_m) ** 2 / (2.0 * p.sigma1_m**2), radius**2 / (2.0 * p.sigma2_m**2)
        ])  # fmt: skip
        share = np.stack([ring, centre]) / (ring + centre)
        change = -share * u * np.log(np.maximum(u, 1e-9))
        tails += np.clip(
            change, -PRIOR.most_of_flux / PRIOR.tails, PRIOR.most_of_flux / PRIOR.tails
        ).T / len(patterns)
    mean_over_angle = np.eye(WAVES)[:, :1]
    return flux, np.kron(tails, mean_over_angle)


def _width_m(model: DepositionModel) -> float:
    """Root mean square radius of the widest pattern [m]."""
    widths = []
    for pattern in model.patterns:
        reach = pattern.r_m + 5.0 * max(pattern.sigma1_m, pattern.sigma2_m)
        x = np.linspace(-reach, reach, 81)
        flux = pattern.flux_um_per_s(x[:, np.newaxis], x)
        widths.append(np.sqrt(np.sum(flux * (x[:, np.newaxis] ** 2 + x**2)) / flux.sum()))
    return float(max(widths))


def painted_alike(experiments: Sequence[Experiment]) -> np.ndarray:
    """(E,) number of the group of each part: those of one shape, path and setting."""
    group = np.full(len(experiments), -1)
    for k, experiment in enumerate(experiments):
        same = [j for j in range(k) if _alike(experiment, experiments[j])]
        group[k] = group[same[0]] if same else group.max() + 1
    return group


def _alike(first: Experiment, second: Experiment) -> bool:
    if (first.switched_off, first.brushes) != (second.switched_off, second.brushes):
        return False
    extents = [np.round(e.measured_points.extent_m, 3) for e in (first, second)]
    if not np.array_equal(extents[0], extents[1]):
        return False
    clocks = [np.cumsum(e.path.flow * e.path.dwell_s) for e in (first, second)]
    # Paths are the same that keep within a share of the time, a distance [m] and an angle [rad].
    if abs(clocks[0][-1] - clocks[1][-1]) > 0.1 * clocks[0][-1]:
        return False
    # They are compared at so many places.
    rows = [
        np.searchsorted(clock, np.linspace(0.0, clock[-1], 32)).clip(0, len(clock) - 1)
        for clock in clocks
    ]
    places = [e.path.position_m[r] for e, r in zip((first, second), rows, strict=True)]
    turns = [e.path.rotation[r] for e, r in zip((first, second), rows, strict=True)]
    return bool(
        np.abs(places[0] - places[1]).max() < 0.01
        and np.abs(turns[0] - turns[1]).max() < 0.05
        and np.abs(first.surface.down - second.surface.down).max() < 0.05
    )
