"""A campaign prepared for inference: point means, noise, blocks and forward model."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import groupby
from operator import attrgetter
from typing import Any

import numpy as np
from scipy.cluster.vq import kmeans2
from scipy.optimize import lsq_linear
from scipy.stats import chi2

from paint_deposition.effects.base import Effect
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.spray_geometry import facet_errors_um
from paint_deposition.inference.fitting.forward import Forward
from paint_deposition.inference.fitting.least_squares import Fit, fit_at, fit_readings
from paint_deposition.inference.fitting.outliers import Outlier
from paint_deposition.inference.fitting.parameters import FreeParameters
from paint_deposition.inference.fitting.random_effects import (
    RandomEffects,
    amounts,
    levels_untold,
    random_effects,
)
from paint_deposition.inference.readings.campaign import Campaign
from paint_deposition.inference.readings.covariates import Rays
from paint_deposition.inference.readings.gauge_noise import GaugeNoise, gauge_noise
from paint_deposition.inference.readings.plausibility import check_unit
from paint_deposition.inference.readings.readings import Residuals, root_mean_square

# Times that points are left out for cross-validation, each of them once.
FOLDS = 6
# The film's own variation from spot to spot, which no model predicts and repeats do not average
# out, as a standard deviation over the film: assumed where the readings do not show it.
TEXTURE_SHARE = 0.01
# Parts and gauge sessions that differ so improbably are no usual ones.
UNUSUAL = 0.02
# Error at the fitted points over gauge and texture beyond which more is missing than levels.
MOST_OFF = 1.25

# Data that are simply wrong, see ``mistaken_data``: a sentence with the remedy, and whether
# nothing can be concluded from them.
Mistake = tuple[str, bool]


@dataclass(frozen=True)
class Study:
    """A campaign with everything that inference needs of it."""

    campaign: Campaign  # the experiments
    forward: Forward  # predicts the P points
    noise: GaugeNoise  # of single readings
    # Of the film, as estimated from readings near each other; None: assumed.
    estimated_texture: float | None = None
    outliers: tuple[Outlier, ...] = ()  # single readings that were left out, see ``clean_and_fit``
    mistakes: tuple[Mistake, ...] = ()  # what is simply wrong with the data, found there, too
    # (P,) film that the facets of curved meshes cost, see ``with_facets`` [um].
    facet_um: np.ndarray | None = None
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
        if campaign.scan and noise.source == 'stated':
            noise = replace(noise, source='neighbours')
        campaign = campaign.without(noise.gross)
        return Study(campaign, Forward(campaign, effects), noise.select(~noise.gross))

    @property
    def measured_um(self) -> np.ndarray:
        """(P,) means over repeats [um]."""
        return self.campaign.readings.mean_um

    @cached_property
    def sigma_um(self) -> np.ndarray:
        """(P,) standard deviation of the points: gauge, texture, and what facets cost [um]."""
        return np.hypot(self.gauge_um, self.texture_um)

    @property
    def texture_share(self) -> float:
        """Texture over the film, as a standard deviation."""
        return self.estimated_texture or TEXTURE_SHARE

    @property
    def texture_um(self) -> np.ndarray:
        """(P,) the same without the gauge's, which repeats do not average out [um]."""
        facets_um = 0.0 if self.facet_um is None else self.facet_um
        return np.hypot(self.texture_share * self.measured_um, facets_um)

    def with_facets(self, model: DepositionModel) -> 'Study':
        """The study with what facets cost under a model, if it shows beside the noise."""
        parts = ((e.surface, e.measured_points, e.path) for e in self.campaign.experiments)
        facet_um = np.concatenate([facet_errors_um(*part, model) for part in parts])
        if np.all(np.abs(facet_um) < 0.1 * self.sigma_um):
            return self
        return replace(self, facet_um=facet_um)

    def of_points(self, kept: np.ndarray) -> 'Study':
        """The study with some of the points only, (P,) bool.

        Raises:
            ReadingsError: an experiment has no reading left.
        """
        left_out = ~kept[self.campaign.readings.owner]
        campaign = self.campaign.without(left_out)
        forward = Forward(campaign, self.forward.effects)
        facet_um = None if self.facet_um is None else self.facet_um[kept]
        noise = self.noise.select(~left_out)
        return replace(
            self, campaign=campaign, forward=forward, noise=noise, facet_um=facet_um, _rays={}
        )

    @property
    def gauge_um(self) -> np.ndarray:
        """(P,) standard deviation of the points from the gauge alone, without texture [um]."""
        readings = self.campaign.readings
        return np.sqrt(np.bincount(readings.owner, self.noise.sigma_um**2)) / readings.repeats

    def __len__(self) -> int:
        return len(self.measured_um)

    def fit(
        self, parameters: FreeParameters, starts: int = 1, seed: int = 0,
        nuisance: np.ndarray | None = None, discrepancy: np.ndarray | None = None,
        others: Sequence[DepositionModel] = (),
    ) -> Fit:  # fmt: skip
        """Fit these parameters to the points; see ``fit_readings``."""
        data = self.forward, self.measured_um, self.sigma_um
        return fit_readings(*data, parameters, starts, seed, nuisance, discrepancy, others)

    def beside(self, parameters: FreeParameters, vector: np.ndarray) -> Fit:
        """The model that a vector (k,) of parameters stands for, beside the points."""
        data = self.forward, self.measured_um, self.sigma_um
        return fit_at(*data, parameters, vector, self.nuisance)

    def residuals(self, predicted_um: np.ndarray) -> Residuals:
        """The P points beside predictions (P,) for them [um].

        This is the one residual that all results quote: what the nuisance directions explain,
        such as the levels in which parts differ, is estimated and counts as predicted.
        """
        misfit = (self.measured_um - predicted_um) / self.sigma_um
        levelled_um = self.measured_um - self.sigma_um * _beside(self.nuisance, misfit)
        return Residuals(self.measured_um, levelled_um, self.sigma_um)

    def residuals_by_experiment(self, predicted_um: np.ndarray) -> tuple[Residuals, ...]:
        """Residuals of each experiment on its own."""
        residuals, owner = self.residuals(predicted_um), self.campaign.experiment_of
        return tuple(residuals.select(owner == k) for k in range(len(self.campaign.experiments)))

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the readings for the user."""
        notes = [] if self.noise.source != 'assumed' else [
            'The noise of the gauge was assumed (0.7 µm and 1 %); take 6 or more second readings, '
            'on a display that shows how they differ, for p-values that can be trusted.'
        ]  # fmt: skip
        if self.estimated_texture:
            share = f'{100.0 * self.estimated_texture:.2g} % of the film'
            notes.append(
                f"The film's own texture is {share}, estimated from neighbouring readings."
            )
        if scan := self.campaign.scan:
            notes.append(
                f'{len(scan.readings)} readings were condensed to the means of {len(self)} '
                'cells, but for parts with few: all figures, and residuals.csv, are of the cells.'
            )
        return (*notes, *self._facet_notes, *self.left_out)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is simply wrong with the data, a line each."""
        return tuple(sentence for sentence, _ in self.mistakes)

    @property
    def left_out(self) -> tuple[str, ...]:
        """A line for each point at which readings were left out."""
        # Two points that look swapped follow each other, and share a line.
        before = (None, *(one.point for one in self.outliers))
        slips = [
            one for one, last in zip(self.outliers, before, strict=False)
            if last is None or one.swapped_with != last
        ]  # fmt: skip
        labels = tuple(one.point.replace(': ', ": point '", 1) + "'" for one in self.outliers)
        notes = [note for note in self.campaign.notes if not note.startswith(labels)]
        return (*notes, *map(str, slips))

    @property
    def noise_figures(self) -> dict[str, Any]:
        """Noise and texture as results name them."""
        return {
            'sigma_um': self.noise.typical_um,
            'source': self.noise.source,
            'texture_share': self.texture_share,
            'texture_source': 'neighbours' if self.estimated_texture else 'assumed',
        }

    @property
    def noise_floor_um(self) -> float:
        """Root mean square of the points' standard deviations: gauge, texture, facets [um]."""
        return root_mean_square(self.sigma_um)

    @cached_property
    def random_effects(self) -> tuple[RandomEffects, ...]:
        """By how much parts and gauge sessions differ; none with one part and one session."""
        every = np.ones(len(self), dtype=bool)
        return random_effects(self.campaign, self.measured_um, self.sigma_um, every)

    @cached_property
    def nuisance(self) -> np.ndarray:
        """(P, n) nuisance directions over the noise: those of the random effects."""
        return _columns(self.random_effects, len(self))

    def level_doubt(self, fit: Fit) -> tuple[float, str]:
        """Probability that usual parts and gauge sessions differ so, and how; '' if they may."""
        effects = self.random_effects
        if not effects:
            return 1.0, ''
        # Where more is off than gauge and texture, what is missing may look like levels.
        off = self.residuals(fit.predicted_um).rmse_um / self.noise_floor_um
        is_off = off > MOST_OFF
        # Amplitudes of unit variance, and the share of it that the readings tell.
        mean, covariance = (fit if is_off else replace(fit, discrepancy=None)).amplitudes
        shares, ways = np.linalg.eigh(np.eye(len(mean)) - covariance)
        seen = shares > 0.5
        square = float(np.sum((ways[:, seen].T @ mean) ** 2 / shares[seen]))
        square /= off**2 if is_off and fit.discrepancy is None else 1.0
        p_value = float(chi2.sf(square, np.count_nonzero(seen)))
        if p_value > UNUSUAL:
            return p_value, ''
        levels = []
        estimated = amounts(*fit.amplitudes, effects)
        for kind, of_kind in groupby(estimated, key=attrgetter('kind')):
            found = [*of_kind]
            told = ', '.join(f'{one.of} {one.value:+.1f} {one.unit}' for one in found)
            steps = np.diff([one.value for one in found])
            way = ', rising' if (steps > 0.0).all() else ', falling' if (steps < 0.0).all() else ''
            way *= len(found) > 2
            levels.append(f'{kind}s {told}{way}')
        return p_value, (
            f'The levels of the parts differ by more than usual (p = {p_value:.2g}): '
            f'{"; ".join(levels)}. Check flow, booth and gauge from part to part.'
        )

    def predicted_without_um(
        self, fit: Fit, out: np.ndarray, free: np.ndarray | None = None
    ) -> np.ndarray:
        """(P,) film by the model of a fit, refitted without some readings [um].

        Args:
            fit: whose parameters are fitted anew, from where they are.
            out: (P,) bool, the readings left out.
            free: (P, n) directions over the noise, of unit variance, that are fitted, too, and
                count as predicted; default: none.
        """
        effects = random_effects(self.campaign, self.measured_um, self.sigma_um, ~out)
        nuisance, own = _columns(effects, len(self)), np.empty((len(self), 0))
        own = own if free is None else free
        count, kept = own.shape[1], (~out)[:, np.newaxis]
        found = fit_readings(
            self.forward, self.measured_um, np.where(out, 1e9, self.sigma_um),
            replace(fit.parameters, start=fit.model), nuisance=kept * np.hstack([own, nuisance]),
            others=(fit.parameters.start,),
        )  # fmt: skip
        # Levels that other readings tell are predicted, too: of the film that is predicted.
        film_um, amounts = found.predicted_um, found.amplitudes[0]
        levels = _columns(random_effects(self.campaign, film_um, self.sigma_um, ~out), len(self))
        return film_um + self.sigma_um * (own @ amounts[:count] + levels @ amounts[count:])

    def errors_left_out_um(self, predict: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """(...) root mean square errors on parts that are left out in turn [um].

        Args: see ``squares_left_out_um2``.
        """
        return np.sqrt(np.mean(self.squares_left_out_um2(predict, self.folds()), axis=-1))

    def squares_left_out_um2(
        self, predict: Callable[[np.ndarray], np.ndarray], folds: np.ndarray
    ) -> np.ndarray:
        """(..., P) squared errors at the points of folds that are left out in turn [um2].

        Levels of which the other readings say nothing are estimated from the part's own, as in
        ``residuals``: see ``levels_untold``.

        Args:
            predict: gives (..., P) films by models that were made without some readings, (P,)
                bool [um].
            folds: (P,) number of the fold of each point: ``folds``, ``patches`` or ``scattered``.
        """
        found = []
        for fold in np.unique(folds):
            out = folds == fold
            films_um = predict(out)
            errors_um = np.zeros(films_um.shape)
            for row in np.ndindex(films_um.shape[:-1]):
                levels = levels_untold(self.campaign, films_um[row], self.sigma_um, ~out)[out]
                misfit = ((self.measured_um - films_um[row]) / self.sigma_um)[out]
                errors_um[row][out] = self.sigma_um[out] * _beside(levels, misfit)
            found.append(errors_um)
        return np.sum(found, axis=0) ** 2

    @property
    def _facet_notes(self) -> tuple[str, ...]:
        if self.facet_um is None:
            return ()
        found = []
        owner = self.campaign.experiment_of
        for number, name in enumerate(e.name for e in self.campaign.experiments):
            off_um = np.where(owner == number, np.abs(self.facet_um), 0.0)
            worst = int(off_um.argmax())
            if off_um[worst] > self.gauge_um[worst]:
                found.append(
                    f'The mesh of {name} is coarser than its curvature allows: its facets put the '
                    f'film off by up to {off_um[worst]:.1f} µm at the readings, where gauge noise '
                    f'is {self.gauge_um[worst]:.1f} µm. That counts as noise; export the mesh '
                    'finer.'
                )
        return tuple(found)

    def has(self, setting: str) -> np.ndarray:
        """(P,) bool, whether the cell had a setting that an effect needs switched on."""
        parts = [setting not in e.switched_off for e in self.campaign.experiments]
        return np.array(parts)[self.campaign.experiment_of]

    def rays(self, model: DepositionModel) -> list[Rays]:
        """The rays of each experiment for a model's pattern and projection."""
        key = (model.patterns, model.projection)
        if key not in self._rays:
            self._rays.clear()
            self._rays[key] = [Rays.of(e, model) for e in self.campaign.experiments]
        return self._rays[key]

    def covariates(self, model: DepositionModel) -> dict[str, np.ndarray]:
        """(P,) covariates of all points, by name."""
        parts = [rays.covariates for rays in self.rays(model)]
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}

    @property
    def leaves_out_parts(self) -> bool:
        """Whether whole parts are left out in turn for the error that was not fitted, or patches.

        Each fold needs a part outside it that was painted with everything switched on: what acts
        with the voltage only cannot be predicted from parts without it.
        """
        parts = enumerate(self.campaign.experiments)
        return len({k % FOLDS for k, part in parts if not part.switched_off}) > 1

    def folds(self) -> np.ndarray:
        """(P,) number of the fold in which each point is left out, with its part or its patch."""
        owner = self.campaign.experiment_of
        return owner % FOLDS if self.leaves_out_parts else self.patches()

    def patches(self) -> np.ndarray:
        """(P,) number of the patch of its part in which each point lies."""
        patch, part = np.zeros(len(self), dtype=int), self.campaign.experiment_of
        for k in range(len(self.campaign.experiments)):
            places = self.campaign.positions_m[part == k]
            count = min(FOLDS, len(np.unique(places, axis=0)))
            patch[part == k] = kmeans2(places / places.std(), count, minit='++', rng=0)[1]
        return patch

    def scattered(self) -> np.ndarray:
        """(P,) number of a fold of points that lie anywhere among those of their part."""
        random, part = np.random.default_rng(0), self.campaign.experiment_of
        fold = np.zeros(len(self), dtype=int)
        for k in range(len(self.campaign.experiments)):
            fold[part == k] = random.permutation(np.count_nonzero(part == k)) % FOLDS
        return fold

    def passes(self, model: DepositionModel) -> np.ndarray:
        """(P,) pass, from 0 in each experiment, that left most of the film at each point."""
        return np.concatenate([rays.main_pass for rays in self.rays(model)])


def _beside(columns: np.ndarray, misfit: np.ndarray) -> np.ndarray:
    """(P,) what directions (P, n), of unit variance, leave of a misfit over the noise.

    No level is taken to be further off than four standard deviations: the model is.
    """
    if not columns.size:
        return misfit
    weighted = np.vstack([columns, np.eye(columns.shape[1])])
    wanted = np.append(misfit, np.zeros(columns.shape[1]))
    return misfit - columns @ lsq_linear(weighted, wanted, (-4.0, 4.0)).x


def _columns(effects: Sequence[RandomEffects], count: int) -> np.ndarray:
    """(P, n) directions of random effects at so many points."""
    return np.hstack([np.empty((count, 0)), *(each.columns for each in effects)])
