"""A campaign prepared for inference: point means, noise, blocks and forward model."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.cluster.vq import kmeans2

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.fitting.forward import Forward
from paint_deposition.fitting.least_squares import Fit, fit_readings
from paint_deposition.fitting.parameters import FreeParameters
from paint_deposition.readings.campaign import Campaign
from paint_deposition.readings.covariates import Covariate, Rays, along_rays, covariates
from paint_deposition.readings.gauge_noise import GaugeNoise, gauge_noise
from paint_deposition.readings.plausibility import check_unit
from paint_deposition.readings.residuals import Residuals, root_mean_square

# Blocks for cross-validation hold about this many points, and each part has at least some blocks.
POINTS_A_PATCH, FEWEST_PATCHES = 8, 4
# The film's texture: it varies from spot to spot by about this share for reasons that no model
# follows, and repeats at one spot do not average it out.
TEXTURE_SHARE = 0.01
# Parts painted alike differ in their mean film by about this share: 4 % was found for clearcoat
# on 40 panels, the gauge and the booth's day included.
LEVEL_SHARE = 0.03
# Without voltage, or without the booth's air, another share of the paint arrives.
OTHER_LEVEL_SHARE = 0.3
# The gauge's zero shifts by about this much from session to session and from operator to operator;
# 0.3 to 1 um are usual [um].
SESSION_UM = 0.7


@dataclass(frozen=True)
class Study:
    """A campaign with everything that inference needs of it.

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
        noise = gauge_noise(campaign.readings)
        campaign, noise = campaign.without(noise.gross), noise.without_gross()
        means = campaign.means
        variance = np.bincount(means.owner, noise.sigma_um**2) / means.repeats**2
        sigma = np.sqrt(variance + (TEXTURE_SHARE * means.mean_um) ** 2)
        return Study(campaign, Forward(campaign, effects), means.mean_um, sigma, noise)

    def __len__(self) -> int:
        return len(self.measured_um)

    def fit(
        self,
        parameters: FreeParameters,
        starts: int = 1,
        seed: int = 0,
        nuisance: np.ndarray | None = None,
    ) -> Fit:
        """Fit these parameters to the points; see ``fit_readings``."""
        return fit_readings(
            self.forward, self.measured_um, self.sigma_um, parameters, starts, seed, nuisance
        )

    def residuals(self, predicted_um: np.ndarray) -> Residuals:
        """The P points beside predictions (P,) for them [um]."""
        return Residuals(self.measured_um, predicted_um, self.sigma_um)

    def residuals_by_experiment(self, predicted_um: np.ndarray) -> tuple[Residuals, ...]:
        """The same for each experiment on its own."""
        residuals, owner = self.residuals(predicted_um), self.campaign.experiment_of
        return tuple(residuals.select(owner == k) for k in range(len(self.campaign.experiments)))

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the readings for the user."""
        if self.noise.source != 'assumed':
            return self.campaign.notes
        return (
            'The noise of the gauge was assumed (0.7 µm and 1 %); take 6 or more repeats for '
            'p-values that can be trusted.',
            *self.campaign.notes,
        )

    @property
    def noise_floor_um(self) -> float:
        """Root mean square of the points' standard deviations [um]."""
        return root_mean_square(self.sigma_um)

    @cached_property
    def nuisance(self) -> np.ndarray:
        """(P, 2 E) nuisance directions over the noise: a film level and a gauge zero per part.

        Only differences between parts count: what all parts have in common is for K1 and the
        effects to explain. (P, 0) with one part.
        """
        parts = len(self.campaign.experiments)
        if parts == 1:
            return np.empty((len(self), 0))
        own = (self.campaign.experiment_of[:, np.newaxis] == np.arange(parts)) - 1.0 / parts
        share = np.array([OTHER_LEVEL_SHARE if e.switched_off else LEVEL_SHARE
                          for e in self.campaign.experiments])  # fmt: skip
        levels_um = share * self.measured_um[:, np.newaxis]
        return np.hstack([own * size / self.sigma_um[:, np.newaxis]
                          for size in (levels_um, SESSION_UM)])  # fmt: skip

    def has(self, effect: type[Effect]) -> np.ndarray:
        """(P,) bool, whether the cell had what an effect needs switched on."""
        parts = [effect.needs not in e.switched_off for e in self.campaign.experiments]
        return np.array(parts)[self.campaign.experiment_of]

    def rays(self, model: DepositionModel) -> list[Rays]:
        """The rays of each experiment for a model's pattern and projection."""
        key = (model.planar, model.projection)
        if key not in self._rays:
            self._rays.clear()
            self._rays[key] = [Rays.of(e, model) for e in self.campaign.experiments]
        return self._rays[key]

    def along_rays(self, model: DepositionModel) -> list[dict[str, np.ndarray]]:
        """Covariates along the rays of each experiment."""
        parts = zip(self.campaign.experiments, self.rays(model), strict=True)
        return [along_rays(experiment, model, rays) for experiment, rays in parts]

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
        """(P,) number of the patch of neighbouring points that each point belongs to."""
        numbers = np.zeros(len(self), dtype=int)
        for index in range(len(self.campaign.experiments)):
            rows = np.flatnonzero(self.campaign.experiment_of == index)
            wanted = max(FEWEST_PATCHES, len(rows) // POINTS_A_PATCH)
            positions_m = self.campaign.positions_m[rows]
            places, label = np.unique(positions_m, axis=0, return_inverse=True)
            if len(places) > wanted:
                _, label = kmeans2(positions_m, wanted, minit='++', seed=seed)
            numbers[rows] = numbers.max() + 1 + label.ravel()
        return numbers

    def passes(self, model: DepositionModel) -> np.ndarray:
        """(P,) pass, from 0 in each experiment, that on average painted each point."""
        means = next(c for c in self.covariates(model) if c.name == 'spray_pass').values
        return np.round(means).astype(int)

    def pass_blocks(self, model: DepositionModel) -> np.ndarray:
        """(P,) number of the block of points that one pass painted; parts share no block."""
        labels = np.column_stack([self.campaign.experiment_of, self.passes(model)])
        return np.unique(labels, axis=0, return_inverse=True)[1].ravel()
