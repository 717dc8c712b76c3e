"""Comparison of model and readings: residuals, their dependence on covariates, regions."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from itertools import combinations
from operator import itemgetter
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.spray_geometry import SprayGeometry
from paint_deposition.inference.comparison.zone_readings import ZoneReadings, zone_readings
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.plausibility import geometry_by_experiment
from paint_deposition.inference.readings.residuals import Residuals

# Regions are discs of these radii about a point [m], or bands of some sixths of the height.
RADII_M = (0.08, 0.12, 0.18, 0.26, 0.36)
BANDS = 6
FEWEST = 2
MOST_REGIONS = 6
# A region that is wider than this share of its part has no place across it [%].
MOST_OF_WIDTH = 60.0
# Readings within this width have none [m].
LEAST_WIDTH_M = 0.05
# Significance level: the probability that noise alone gives a part any region.
SIGNIFICANCE = 0.02
DRAWS = 1000
SEED = 0


@dataclass(frozen=True)
class Region:
    """Neighbouring points whose mean residual is significant."""

    description: str  # in words, for a report
    experiment: str  # name
    rows: np.ndarray  # (n,) points of the study
    readings: int  # single readings at those points
    mean_residual_um: float  # measured minus predicted [um]

    def to_dict(self) -> dict[str, Any]:
        """An entry of ``regions`` in the files of results."""
        names = ('description', 'experiment', 'readings', 'mean_residual_um')
        return {name: getattr(self, name) for name in names}


def misfit_regions(study: Study, points: Residuals, model: DepositionModel) -> list[Region]:
    """Significant regions, strongest first.

    Args:
        points: residuals of the study's P points.
        model: gives the incidence that the descriptions quote.
    """
    values = {c.name: c.values for c in study.covariates(model)}
    random = np.random.default_rng(SEED)
    found = []
    for index, experiment in enumerate(study.campaign.experiments):
        rows = np.flatnonzero(study.campaign.experiment_of == index)
        places = _windows(study.campaign.positions_m[rows], values['height_fraction'][rows])
        if not len(places):
            continue
        noise = np.abs(places @ random.normal(size=(len(rows), DRAWS))).max(axis=0)
        threshold = float(np.quantile(noise, 1.0 - SIGNIFICANCE))
        left = points.residual_um[rows] / points.sigma_um[rows]
        for _ in range(MOST_REGIONS):
            scores = places @ left
            best = int(np.argmax(np.abs(scores)))
            if abs(scores[best]) < threshold:
                break
            members = places[best] > 0.0
            region = rows[members]
            readings = int(study.campaign.means.repeats[region].sum())
            mean = float(np.mean(points.residual_um[region]))
            words = _described(values, region, rows, readings, mean)
            described = Region(words, experiment.name, region, readings, mean)
            found.append((-abs(scores[best]), described))
            # The next region is sought among the other points.
            left = np.where(members, 0.0, left)
    return [region for _, region in sorted(found, key=itemgetter(0))]


def _windows(positions_m: np.ndarray, height: np.ndarray) -> np.ndarray:
    """(W, P) windows over the points: discs about each and bands of height, of unit length.

    A window's product with independent deviations is standard normal, so the largest over all
    windows can be compared with that of noise (spatial scan: Kulldorff 1997).
    """
    distance = np.linalg.norm(positions_m[:, np.newaxis] - positions_m[np.newaxis], axis=2)
    discs = [distance < radius for radius in RADII_M]
    ends = combinations(np.linspace(0.0, 1.0, BANDS + 1), 2)
    bands = [(height >= low) & (height <= high) for low, high in ends]
    members = np.unique(np.vstack([*discs, *bands]), axis=0).astype(float)
    count = members.sum(axis=1, keepdims=True)
    enough = (count[:, 0] >= FEWEST) & (count[:, 0] < len(positions_m))
    return (members / np.sqrt(np.maximum(count, 1.0)))[enough]


def _described(
    values: dict[str, np.ndarray], region: np.ndarray, rows: np.ndarray, readings: int,
    mean_um: float,
) -> str:  # fmt: skip
    incidence = values['incidence_deg'][region]
    return (
        f'{_place(values, region, rows)}, {readings} readings, model {abs(mean_um):.1f} µm '
        f'{"low" if mean_um > 0 else "high"}, incidence {incidence.min():.0f}-'
        f'{incidence.max():.0f} deg'
    )


def _place(values: dict[str, np.ndarray], region: np.ndarray, rows: np.ndarray) -> str:
    """The thirds of the part's height, and the share of its width from the left, if not all."""
    low, high = np.quantile(values['height_fraction'][region], [0.1, 0.9])
    first, last = (int(min(2, max(0, 3 * value))) for value in (low, high))
    thirds = ['lower third', 'middle third', 'upper third'][first : last + 1]
    vertical = 'full height' if len(thirds) == 3 else ' and '.join(thirds)
    across = values['across_m']
    share = (across[region] - across[rows].min()) / max(np.ptp(across[rows]), 1e-9)
    left, right = 100.0 * np.quantile(share, [0.1, 0.9])
    if right - left > MOST_OF_WIDTH or np.ptp(across[rows]) < LEAST_WIDTH_M:
        return vertical
    place = f'{left:.0f}' if right - left < 1.0 else f'{left:.0f} to {right:.0f}'
    return f'{vertical} at {place} % of the width from the left'


@dataclass(frozen=True)
class Misfit:
    """How far the model is off on some of the readings."""

    # Which readings: kind is 'experiment', 'group' or 'pass'.
    experiment: str
    kind: str
    label: str
    residuals: Residuals

    def to_dict(self) -> dict[str, Any]:
        """An entry of ``misfits`` in the files of results."""
        of = {'experiment': self.experiment, 'kind': self.kind, 'label': self.label}
        return of | self.residuals.figures()


@dataclass(frozen=True)
class Dependence:
    """Residual against one covariate: Spearman's rank correlation and its p-value."""

    covariate: str
    correlation: float
    p_value: float


@dataclass(frozen=True)
class Comparison:
    """The model compared with the readings.

    Attributes:
        study: the campaign, with the noise of its gauge and notes for the user.
        readings: residuals of every reading used, experiments in order.
        points: residuals of the points, averaged over repeats.
        misfits: of each experiment, its groups and its passes.
        dependences: strongest first.
        regions: where the misfit is significant, strongest first.
        model: what was compared with the readings.
        zones: the readings of each zone of each part beside its target, if there are zones.
        warnings: why a model that was fitted to the readings is not to be trusted.
    """

    study: Study
    readings: Residuals
    points: Residuals
    misfits: tuple[Misfit, ...]
    dependences: tuple[Dependence, ...]
    regions: tuple[Region, ...]
    model: DepositionModel
    zones: tuple[ZoneReadings, ...] = ()
    warnings: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return (
            f'Comparison({len(self.readings)} readings, RMSE {self.readings.rmse_um:.2f} µm, '
            f'gauge noise {self.study.noise.typical_um:.2f} µm, '
            f'{len(self.regions)} regions of misfit)'
        )

    @cached_property
    def geometry(self) -> dict[str, SprayGeometry]:
        """How the gun ran over each part, by experiment."""
        return geometry_by_experiment(self.study.campaign, self.model)

    def to_dict(self) -> dict[str, Any]:
        """The content of ``comparison.json``."""
        return {
            'geometry': {name: found.to_dict() for name, found in self.geometry.items()},
            'readings': len(self.readings),
            'noise': self.study.noise_figures,
            'left_out': [outlier.to_dict() for outlier in self.study.outliers],
            'misfits': [misfit.to_dict() for misfit in self.misfits],
            'zones': [zone.to_dict() for zone in self.zones],
            'regions': [region.to_dict() for region in self.regions],
            'dependences': [asdict(dependence) for dependence in self.dependences],
            'notes': [*self.warnings, *self.study.notes],
        }


@dataclass(frozen=True)
class SideBySide:
    """Several models compared with the same readings.

    Attributes:
        by_name: a comparison for each model, in the order asked for, by the model's name.
    """

    by_name: Mapping[str, Comparison]

    def __repr__(self) -> str:
        errors = (f'{name} {c.points.rmse_um:.2f}' for name, c in self.by_name.items())
        return f'SideBySide(RMSE {", ".join(errors)} µm)'

    @property
    def best(self) -> str:
        """The model with the least error at the points."""
        return min(self.by_name, key=lambda name: self.by_name[name].points.rmse_um)

    def to_dict(self) -> dict[str, Any]:
        """The content of ``comparison.json``: of the best model, and of each by its name."""
        each = [
            {'name': name, 'rmse_um': c.points.rmse_um} | c.to_dict()
            for name, c in self.by_name.items()
        ]
        return {'best': self.best, 'models': each}


def compare(study: Study, model: DepositionModel) -> Comparison:
    """Predict every reading and summarise the misfit."""
    points = study.residuals(study.forward.predict_um(model))
    campaign = study.campaign
    predicted_um = points.predicted_um[campaign.means.owner]
    readings = Residuals(campaign.readings.thickness_um, predicted_um, study.noise.sigma_um)
    dependences = [
        Dependence(one.name, *map(float, spearmanr(one.values, points.residual_um)))
        for one in study.covariates(model)
        if one.varies
    ]
    return Comparison(
        study, readings, points, tuple(_misfits(study, model, readings)),
        tuple(sorted(dependences, key=lambda d: d.p_value)),
        tuple(misfit_regions(study, points, model)), model, zone_readings(campaign, readings),
    )  # fmt: skip


def _misfits(study: Study, model: DepositionModel, residuals: Residuals) -> Iterator[Misfit]:
    owner = study.campaign.means.owner
    experiment_of = study.campaign.experiment_of[owner]
    groups, passes = study.campaign.readings.group, study.passes(model)[owner]
    for number, experiment in enumerate(study.campaign.experiments):
        here, name = experiment_of == number, experiment.name
        yield Misfit(name, 'experiment', name, residuals.select(here))
        for label in dict.fromkeys(experiment.readings.group):
            if label:
                yield Misfit(name, 'group', str(label), residuals.select(here & (groups == label)))
        painted_by = np.unique(passes[here])
        for k in painted_by if len(painted_by) > 1 else ():
            yield Misfit(name, 'pass', f'pass {k + 1}', residuals.select(here & (passes == k)))
