"""Comparison of model and readings: residuals, their dependence on covariates, zones.

Zones stand beside their targets as on an acceptance sheet.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.spray_geometry import SprayGeometry
from paint_deposition.inference.comparison.regions import Region, misfit_regions
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.campaign import Campaign
from paint_deposition.inference.readings.covariates import varies
from paint_deposition.inference.readings.plausibility import geometry_by_experiment
from paint_deposition.inference.readings.readings import Residuals
from paint_deposition.part.zones import Zone


@dataclass(frozen=True)
class ZoneReadings:
    """The readings of a zone of a part; figures are None where it has none."""

    experiment: str  # name
    name: str  # of the zone
    target_um: float
    tolerance_um: float
    readings: int
    mean_um: float | None = None  # measured
    min_um: float | None = None
    max_um: float | None = None
    mean_predicted_um: float | None = None
    within: float | None = None  # share of the readings within the tolerance, 0 to 1
    # The reading furthest from the target, and its point.
    worst_um: float | None = None
    worst_point: str | None = None

    @staticmethod
    def of(experiment: str, zone: Zone, found: Residuals, points: np.ndarray) -> ZoneReadings:
        """The readings (n,) of a zone, and the points (n,) where they were taken."""
        wanted = experiment, zone.name, zone.target_um, zone.tolerance_um
        measured = found.measured_um
        if not len(measured):
            return ZoneReadings(*wanted, 0)
        off = np.abs(measured - zone.target_um)
        return ZoneReadings(
            *wanted, len(measured), float(measured.mean()), float(measured.min()),
            float(measured.max()), float(found.predicted_um.mean()),
            float(np.mean(off <= zone.tolerance_um)), float(measured[off.argmax()]),
            str(points[off.argmax()]),
        )  # fmt: skip

    @property
    def verdict(self) -> str:
        """'accepted', how many readings are out, or that there are none."""
        if self.within is None:
            return 'not measured'
        out = self.readings - round(self.within * self.readings)
        return f'{out} of {self.readings} out' if out else 'accepted'

    @property
    def sentence(self) -> str:
        """The zone in a line."""
        band = f'{self.name}, {self.target_um:g} ± {self.tolerance_um:g} µm'
        if self.within is None:
            return f'{self.experiment}: {band}: no readings'
        return (
            f'{self.experiment}: {band}: {self.readings} readings, {self.mean_um:.1f} µm measured '
            f'and {self.mean_predicted_um:.1f} µm predicted on average, '
            f'{100 * self.within:.0f} % within, worst {self.worst_um:.1f} µm at {self.worst_point}'
        )

    def to_dict(self) -> dict[str, Any]:
        """An entry of ``zones`` in the files of results."""
        return asdict(self) | {'verdict': self.verdict}


def zone_readings(campaign: Campaign, readings: Residuals) -> tuple[ZoneReadings, ...]:
    """The zones of each experiment, by the residuals of all N readings used."""
    owner, found = campaign.experiment_of[campaign.readings.owner], []
    for number, experiment in enumerate(campaign.experiments):
        of, own = experiment.zones_of_points, readings.select(owner == number)
        if of is None:
            continue
        points = experiment.readings.point
        for k, zone in enumerate(of.zones):
            inside = (of.number == k)[experiment.readings.owner]
            found.append(
                ZoneReadings.of(experiment.name, zone, own.select(inside), points[inside])
            )
    return tuple(found)


@dataclass(frozen=True)
class Comparison:
    """The model compared with the readings.

    Attributes:
        study: the campaign, with the noise of its gauge and notes for the user.
        readings: residuals of every reading used, experiments in order.
        points: residuals of the points, averaged over repeats.
        misfits: residuals of each experiment, its groups and its passes, by the name of the
            experiment, the kind ('experiment', 'group' or 'pass') and the label.
        dependences: of the residual on each covariate, by its name, strongest first: Spearman's
            rank correlation and its p-value.
        regions: where the misfit is significant, strongest first.
        model: what was compared with the readings.
        zones: the readings of each zone of each part beside its target, if there are zones.
        warnings: why a model that was fitted to the readings is not to be trusted.
    """

    study: Study
    readings: Residuals
    points: Residuals
    misfits: dict[tuple[str, str, str], Residuals]
    dependences: dict[str, tuple[float, float]]
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

    def columns(self) -> dict[str, np.ndarray]:
        """Of every reading, the columns of ``residuals.csv``; NaN where it was left out."""
        parts = self.study.campaign.experiments
        taken, used = [part.taken for part in parts], np.concatenate([part.used for part in parts])
        columns = {'experiment': np.repeat([part.name for part in parts], list(map(len, taken)))}
        for name in ('point', 'group'):
            columns[name] = np.concatenate([getattr(readings, name) for readings in taken])
        positions = np.concatenate([readings.positions_m for readings in taken])
        columns |= dict(zip(('x_m', 'y_m', 'z_m'), positions.T, strict=True))
        columns['thickness_um'] = np.concatenate([readings.thickness_um for readings in taken])
        for name in ('predicted_um', 'residual_um', 'sigma_um'):
            columns[name] = np.full(len(used), np.nan)
            columns[name][used] = getattr(self.readings, name)
        layers = np.concatenate([readings.layer for readings in taken])
        return columns | {'used': used, 'layer': layers}

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
            'misfits': [
                dict(zip(('experiment', 'kind', 'label'), of, strict=True)) | residuals.figures()
                for of, residuals in self.misfits.items()
            ],
            'zones': [zone.to_dict() for zone in self.zones],
            'regions': [region.to_dict() for region in self.regions],
            'dependences': [
                {'covariate': name, 'correlation': correlation, 'p_value': p_value}
                for name, (correlation, p_value) in self.dependences.items()
            ],
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
    predicted_um = points.predicted_um[campaign.readings.owner]
    sigma_um = np.hypot(study.noise.sigma_um, study.texture_um[campaign.readings.owner])
    readings = Residuals(campaign.readings.thickness_um, predicted_um, sigma_um)
    dependences = {}
    for name, values in study.covariates(model).items():
        if varies(values):
            correlation, p_value = map(float, spearmanr(values, points.residual_um))
            dependences[name] = correlation, p_value
    strongest_first = sorted(dependences.items(), key=lambda item: item[1][1])
    return Comparison(
        study, readings, points, _misfits(study, model, readings),
        dict(strongest_first),
        tuple(misfit_regions(study, points, model)), model, zone_readings(campaign, readings),
    )  # fmt: skip


def _misfits(
    study: Study, model: DepositionModel, residuals: Residuals
) -> dict[tuple[str, str, str], Residuals]:
    owner = study.campaign.readings.owner
    experiment_of = study.campaign.experiment_of[owner]
    groups, passes = study.campaign.readings.group, study.passes(model)[owner]
    rows = {}
    for number, experiment in enumerate(study.campaign.experiments):
        here, name = experiment_of == number, experiment.name
        rows[name, 'experiment', name] = here
        for label in filter(None, dict.fromkeys(experiment.readings.group.tolist())):
            rows[name, 'group', label] = here & (groups == label)
        painted_by = np.unique(passes[here])
        for k in painted_by if len(painted_by) > 1 else ():
            rows[name, 'pass', f'pass {k + 1}'] = here & (passes == k)
    return {of: residuals.select(own) for of, own in rows.items()}
