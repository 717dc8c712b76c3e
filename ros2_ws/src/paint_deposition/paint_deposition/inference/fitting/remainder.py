"""What nature leaves over: smooth errors of every part that no law explains and no gauge made.

Sprays of one setting differ from each other, alike in neighbouring places, and their shape changes
with the setting in more ways than any law says. Each part therefore has a smooth error of its own,
shared by parts that were painted alike as far as it is the setting's, and the footprint deviates
from the two Gaussians of eq. (1) on all parts alike. Their sizes and lengths are not known: they
are hyperparameters with a prior from measured sprays, over which every evidence is averaged.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.learned.footprint import WAVES
from paint_deposition.effects.library.tcp_offset import TcpOffset
from paint_deposition.inference.diagnosis.smooth_laws import RADII, footprint_basis
from paint_deposition.inference.fitting.smooth_fields import root_of_field
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.campaign import Experiment
from paint_deposition.model.eq1_pattern import PlanarPattern

# Sizes that are considered, and the prior of each: its median, and the factor that is one standard
# deviation. Of the footprint as a share of the local flux; of settings and parts as a share of the
# part's thickest film, falling with the root of the film.
FOOTPRINTS, USUAL_FOOTPRINT = (0.01, 0.03, 0.1, 0.3), (0.08, 2.5)
SETTINGS, USUAL_SETTING = (0.004, 0.012, 0.035, 0.1), (0.012, 2.0)
PARTS, USUAL_PART = (0.003, 0.01, 0.03), (0.012, 2.0)
# Lengths of correlation, in root mean square radii of the pattern, and of the footprint in steps.
LENGTHS, FOOTPRINT_LENGTHS = (0.2, 0.6), (2.0, 6.0)
NEGLIGIBLE = 1e-3
# Exponents of the tails differ from those of Gaussians by so much.
TAILS = 0.5
# Sprays wander sideways by this share of the pattern's root mean square radius.
WANDER = 0.008
SHIFT_M = 1e-3
WIDE = 3.0
MOST_RELATIVE = 1.0
FAR = 1e6
# Paths that keep within this distance [m], angle [rad] and share of the time are the same.
SAME_PATH_M, SAME_AXIS_RAD, SAME_TIME, PLACES = 0.01, 0.05, 0.1, 32


@dataclass(frozen=True)
class Sizes:
    """Hyperparameters: sizes of footprint, setting and part error, and the errors' length."""

    footprint: float
    setting: float
    part: float
    length: int
    log_prior: float


@dataclass(frozen=True)
class Remainder:
    """Directions of what nature leaves over, (P, n) over the noise for sizes of one.

    Attributes:
        footprint: of the pattern, alike on all parts.
        settings, parts: for each length, of parts painted alike together and of each by itself;
            no direction of the latter where no two parts were painted alike.
    """

    footprint: tuple[np.ndarray, ...]
    shapes: np.ndarray
    settings: tuple[np.ndarray, ...]
    parts: tuple[np.ndarray, ...]

    @staticmethod
    def of(study: Study, fit) -> 'Remainder':
        """Around a fit."""
        model = fit.model
        campaign, sigma = study.campaign, study.sigma_um[:, np.newaxis]
        basis = footprint_basis(study, model)
        flux = relative_flux(model.patterns, basis.settings['reach_m'])
        footprint = tuple(
            np.hstack(
                [
                    basis.film_um
                    @ (
                        np.minimum(size / flux, MOST_RELATIVE)[:, np.newaxis]
                        * basis.random(np.sqrt(1.0 / len(FOOTPRINT_LENGTHS)), length).at_knots
                    )
                    / sigma
                    for length in FOOTPRINT_LENGTHS
                ]
            )
            for size in FOOTPRINTS
        )
        tails = basis.film_um @ tail_directions(model.patterns, basis.settings['reach_m']) / sigma
        footprint = tuple(np.hstack([TAILS * tails, columns]) for columns in footprint)
        film = np.maximum(study.forward.predict_um(model), 0.0)
        owner = campaign.experiment_of
        thickest = np.array([film[owner == k].max() for k in range(len(campaign.experiments))])
        scale = np.sqrt(film * thickest[owner])[:, np.newaxis] / sigma

        def fields(label: np.ndarray, kept: np.ndarray) -> tuple[np.ndarray, ...]:
            found = []
            for length in LENGTHS:
                columns = np.zeros((len(study), 0))
                if kept.any():
                    at = np.column_stack([campaign.positions_m, FAR * label[owner]])[kept]
                    root = root_of_field(at, length * width, NEGLIGIBLE)
                    columns = np.zeros((len(study), root.shape[1]))
                    columns[kept] = root
                found.append(scale * columns)
            return tuple(found)

        group = alike(campaign.experiments)
        width = max(rms_radius_m(p) for p in model.patterns)
        pattern = fit.parameters.pattern
        between = np.array([c.between_jobs for c in pattern.coordinates]) / WIDE
        between[[pattern.entries(row)[0] for row in range(pattern.count)]] = 0.0
        shapes = fit.jacobian[:, : len(pattern)] * between
        alone = np.hstack(
            [shapes * (group[owner] == k)[:, np.newaxis] for k in range(group.max() + 1)]
        )
        if group.max() == 0:
            alone = alone[:, :0]
        wander = WANDER * width * shift_directions(study, model) / sigma
        own = group[owner][:, np.newaxis] == np.arange(group.max() + 1)
        alone = np.hstack([alone, *(wander[:, [k]] * own for k in range(2))])
        shared = np.bincount(group)[group] > 1
        settings = fields(group, np.ones(len(study), dtype=bool))
        return Remainder(
            footprint,
            alone,
            settings,
            fields(np.arange(len(group)), shared[owner]),
        )

    def sizes(self) -> Iterator[Sizes]:
        """All that are considered."""
        parts = PARTS if self.parts[0].shape[1] else (0.0,)
        for f, s, p, k in product(FOOTPRINTS, SETTINGS, parts, range(len(LENGTHS))):
            log_prior = _log_prior(f, *USUAL_FOOTPRINT) + _log_prior(s, *USUAL_SETTING)
            if p > 0.0:
                log_prior += _log_prior(p, *USUAL_PART)
            yield Sizes(f, s, p, k, log_prior)

    def columns(self, sizes: Sizes) -> np.ndarray:
        """(P, n) directions of these sizes."""
        footprint = self.footprint[FOOTPRINTS.index(sizes.footprint)]
        return np.hstack([footprint, self.of_parts(sizes)])

    def of_parts(self, sizes: Sizes) -> np.ndarray:
        """(P, n) the same without the footprint, which all parts share."""
        k = sizes.length
        return np.hstack([
            self.shapes,
            sizes.setting * self.settings[k],
            sizes.part * self.parts[k],
        ])  # fmt: skip


def _log_prior(value: float, usual: float, factor: float) -> float:
    return -0.5 * (np.log(value / usual) / np.log(factor)) ** 2


def relative_flux(patterns, reach_m) -> np.ndarray:
    """(K,) flux at the knots of a footprint over the peak's, on average over the angle."""
    radius = np.linspace(0.0, reach_m, RADII)
    angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)[:, np.newaxis]
    flux = sum(
        p.flux_um_per_s(radius * np.cos(angle), radius * np.sin(angle)).mean(axis=0)
        / p.peak_flux_um_per_s
        for p in patterns
    ) / len(patterns)
    return np.repeat(flux, WAVES)


def tail_directions(patterns, reach_m) -> np.ndarray:
    """(K, 2) relative change of the flux as the tails of ring and centre get shorter or longer."""
    radius = np.linspace(0.0, reach_m, RADII)
    found = np.zeros((RADII, 2))
    for p in patterns:
        ring, centre = (1.0 - p.K2) * p.g1(radius, 0.0), p.K2 * p.g2(radius, 0.0)
        for k, (part, u) in enumerate(
            (
                (ring, (radius - p.r_m) ** 2 / (2.0 * p.sigma1_m**2)),
                (centre, radius**2 / (2.0 * p.sigma2_m**2)),
            )
        ):
            change = part / (ring + centre) * u * np.log(np.maximum(u, 1e-9))
            found[:, k] += np.clip(change, -1.0 / TAILS, 1.0 / TAILS) / len(patterns)
    wave = np.eye(WAVES)[0]
    return np.kron(found, wave[:, np.newaxis])


def shift_directions(study: Study, model: DepositionModel) -> np.ndarray:
    """(P, 2) change of the film as the pattern moves along the tool's x and y axes [um/m]."""
    here = study.forward.predict_um(model)
    old = model.effect('tcp_offset') or TcpOffset()
    moved = []
    for name in ('offset_x_m', 'offset_y_m'):
        step = -SHIFT_M if getattr(old, name) > 0.0 else SHIFT_M
        shifted = old.model_copy(update={name: getattr(old, name) + step})
        moved.append((study.forward.predict_um(model.with_effect(shifted)) - here) / step)
    return np.stack(moved, axis=1)


def rms_radius_m(pattern: PlanarPattern) -> float:
    """Root mean square radius of a pattern [m]."""
    reach = pattern.r_m + 5.0 * max(pattern.sigma1_m, pattern.sigma2_m)
    x = np.linspace(-reach, reach, 81)
    flux = pattern.flux_um_per_s(x[:, np.newaxis], x)
    return float(np.sqrt(np.sum(flux * (x[:, np.newaxis] ** 2 + x**2)) / flux.sum()))


def alike(experiments: tuple[Experiment, ...]) -> np.ndarray:
    """(E,) number of the group of parts that were painted alike."""
    marks = [_mark(experiment) for experiment in experiments]
    group = np.full(len(marks), -1)
    for k, mark in enumerate(marks):
        same = [j for j in range(k) if _same(mark, marks[j])]
        group[k] = group[same[0]] if same else group.max() + 1
    return group


def _mark(experiment: Experiment) -> tuple:
    path = experiment.path
    time = path.flow * path.dwell_s
    clock = np.cumsum(time)
    rows = np.searchsorted(clock, np.linspace(0.0, clock[-1], PLACES)).clip(0, len(clock) - 1)
    points = experiment.measured_points
    return (
        (experiment.switched_off, experiment.brushes, tuple(np.round(points.extent_m, 3))),
        float(clock[-1]), path.position_m[rows], path.rotation[rows][:, :, 2],
    )  # fmt: skip


def _same(first: tuple, second: tuple) -> bool:
    return (
        first[0] == second[0]
        and abs(first[1] - second[1]) < SAME_TIME * first[1]
        and bool(np.abs(first[2] - second[2]).max() < SAME_PATH_M)
        and bool(np.abs(first[3] - second[3]).max() < SAME_AXIS_RAD)
    )
