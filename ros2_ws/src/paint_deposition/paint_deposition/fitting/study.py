"""A campaign made ready for inference: point means, noise, blocks and forward model."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.cluster.vq import kmeans2

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.fitting.forward import Forward
from paint_deposition.fitting.least_squares import Fit, derivatives, fit_readings
from paint_deposition.fitting.parameters import Unknowns
from paint_deposition.readings.campaign import Campaign
from paint_deposition.readings.covariates import Covariate, Rays, covariates
from paint_deposition.readings.gauge_noise import GaugeNoise, gauge_noise
from paint_deposition.readings.plausibility import check_unit

# Blocks that are left out together hold about this many points.
POINTS_A_PATCH = 8
# Film varies from spot to spot by about this share for reasons no model follows; repeats at one
# spot do not average it out.
TEXTURE_SHARE = 0.01
# Parts painted alike differ in their mean film by about this share: 4 % was found for clearcoat
# on 40 panels, the gauge and the booth's day included.
LEVEL_SHARE = 0.03
# A gauge put down and zeroed anew, by another hand, reads otherwise by about this much; 0.3 to
# 1 um are usual.
SESSION_UM = 0.7
FEWEST_PATCHES = 4


@dataclass(frozen=True)
class Study:
    """What every step of an inference needs.

    Attributes:
        campaign: the experiments.
        forward: predicts the P points.
        measured_um: (P,) means over repeats [um].
        sigma_um: (P,) their standard deviations, with the film's texture [um].
        noise: of single readings.
    """

    campaign: Campaign
    forward: Forward
    measured_um: np.ndarray
    sigma_um: np.ndarray
    noise: GaugeNoise
    _rays: dict = field(default_factory=dict, repr=False)

    @staticmethod
    def of(campaign: Campaign, effects: tuple[Effect, ...] = ()) -> 'Study':
        """Prepare a campaign; ``effects`` are those whose amplitudes may be varied.

        Readings that contradict others at their point are left out, see ``notes``.

        Raises:
            ReadingsError: readings in another unit, with the remedy.
        """
        for experiment in campaign.experiments:
            check_unit(experiment.readings)
        noise = gauge_noise([e.readings for e in campaign.experiments])
        campaign, noise = campaign.without(noise.gross), noise.without_gross()
        measured = np.concatenate([e.means.mean_um for e in campaign.experiments])
        variances, start = [], 0
        for experiment in campaign.experiments:
            part = noise.sigma_um[start : start + len(experiment.readings)] ** 2
            start += len(part)
            repeats = experiment.means.repeats
            variances.append(np.bincount(experiment.means.owner, part) / repeats**2)
        texture = TEXTURE_SHARE * measured
        sigma = np.sqrt(np.concatenate(variances) + texture**2)
        return Study(campaign, Forward(campaign, effects), measured, sigma, noise)

    def __len__(self) -> int:
        return len(self.measured_um)

    def fit(
        self,
        unknowns: Unknowns,
        starts: int = 1,
        seed: int = 0,
        extra: np.ndarray | None = None,
    ) -> Fit:
        """Fit these unknowns to the points; see ``fit_readings``."""
        return fit_readings(
            self.forward, self.measured_um, self.sigma_um, unknowns, starts, seed, extra
        )

    def plain(self, fit: Fit) -> Fit:
        """A fit that allowed for levels, seen over nothing but the points' own noise."""
        if self.levels is None:
            return fit
        return replace(
            fit,
            residual=(self.measured_um - fit.predicted_um) / self.sigma_um,
            jacobian=derivatives(
                self.forward, fit.unknowns, fit.vector, self.sigma_um, fit.predicted_um
            ),
            extra_log_det=0.0,
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the readings for the user."""
        if self.noise.source != 'assumed':
            return self.campaign.notes
        return (
            'The noise of the gauge was assumed (0.7 um and 1 %); take 6 or more repeats for '
            'p-values that can be trusted.',
            *self.campaign.notes,
        )

    @property
    def noise_floor_um(self) -> float:
        """Root mean square of the points' standard deviations [um]."""
        return float(np.sqrt(np.mean(self.sigma_um**2)))

    def rmse_um(self, whitened: np.ndarray) -> float:
        """Root mean square of whitened deviations (P,), back in um."""
        return float(np.sqrt(np.mean((whitened * self.sigma_um) ** 2)))

    @cached_property
    def positions_m(self) -> np.ndarray:
        """(P, 3) places on the surface [m]."""
        return np.concatenate([e.points.positions_m[: len(e)] for e in self.campaign.experiments])

    @cached_property
    def experiment_of(self) -> np.ndarray:
        """(P,) number of the experiment of each point."""
        return np.repeat(
            np.arange(len(self.campaign.experiments)), [len(e) for e in self.campaign.experiments]
        )

    @cached_property
    def levels(self) -> np.ndarray | None:
        """(P, 2 E) each part's own level, and its gauge's own zero, over the noise.

        Only as far as parts differ from each other: what they have in common is for K1 and the
        effects to explain. None with one part.
        """
        parts = len(self.campaign.experiments)
        if parts == 1:
            return None
        own = (self.experiment_of[:, np.newaxis] == np.arange(parts)) - 1.0 / parts
        sizes_um = LEVEL_SHARE * self.measured_um, np.full(len(self), SESSION_UM)
        return np.hstack([own * (size / self.sigma_um)[:, np.newaxis] for size in sizes_um])

    def rays(self, model: DepositionModel) -> list[Rays]:
        """The rays of each experiment for a model's pattern and projection."""
        key = (model.planar, model.projection)
        if key not in self._rays:
            self._rays.clear()
            self._rays[key] = [Rays.of(e, model) for e in self.campaign.experiments]
        return self._rays[key]

    def covariates(self, model: DepositionModel) -> list[Covariate]:
        """Covariates of all points."""
        parts = [
            covariates(experiment, model, rays)
            for experiment, rays in zip(self.campaign.experiments, self.rays(model), strict=True)
        ]
        return [
            Covariate(same[0].name, np.concatenate([part.values for part in same]))
            for same in zip(*parts, strict=True)
        ]

    def patches(self, seed: int = 0) -> np.ndarray:
        """(P,) number of the patch of neighbouring points that each belongs to."""
        numbers = np.zeros(len(self), dtype=int)
        for index in range(len(self.campaign.experiments)):
            rows = np.flatnonzero(self.experiment_of == index)
            wanted = max(FEWEST_PATCHES, len(rows) // POINTS_A_PATCH)
            places, label = np.unique(self.positions_m[rows], axis=0, return_inverse=True)
            if len(places) > wanted:
                _, label = kmeans2(self.positions_m[rows], wanted, minit='++', seed=seed)
            numbers[rows] = numbers.max() + 1 + label.ravel()
        return numbers

    def bands(self, model: DepositionModel) -> np.ndarray:
        """(P,) number of the pass that painted each point most, per experiment."""
        rounded = next(c for c in self.covariates(model) if c.name == 'spray_pass').values
        labels = np.column_stack([self.experiment_of, np.round(rounded)])
        return np.unique(labels, axis=0, return_inverse=True)[1].ravel()
