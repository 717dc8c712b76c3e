"""The model beside the readings: where and how much it is off."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.spray_geometry import SprayGeometry
from paint_deposition.inference.comparison.rank_correlation import rank_correlation
from paint_deposition.inference.comparison.regions import Region, misfit_regions
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.geometry import geometry_by_experiment
from paint_deposition.inference.readings.residuals import Residuals


@dataclass(frozen=True)
class Misfit:
    """How far the model is off on some of the readings.

    Attributes:
        experiment, kind, label: which readings: kind is 'experiment', 'group' or 'pass'.
        residuals: of these readings.
    """

    experiment: str
    kind: str
    label: str
    residuals: Residuals


@dataclass(frozen=True)
class Dependence:
    """Residual against one covariate: Spearman's rank correlation and its p-value."""

    covariate: str
    correlation: float
    p_value: float


@dataclass(frozen=True)
class Comparison:
    """The model beside the readings.

    Attributes:
        study: the campaign, with the noise of its gauge and notes for the user.
        readings: residuals of every reading used, experiments in order.
        points: residuals of the points, averaged over repeats.
        misfits: of each experiment, its groups and its passes.
        dependences: strongest first.
        regions: where the misfit is significant, strongest first.
        model: what was compared with the readings.
        warnings: why a model that was fitted to the readings is not to be trusted.
    """

    study: Study
    readings: Residuals
    points: Residuals
    misfits: tuple[Misfit, ...]
    dependences: tuple[Dependence, ...]
    regions: tuple[Region, ...]
    model: DepositionModel
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
            'left_out': [slip.to_dict() for slip in self.study.slips],
            'misfits': [
                {'experiment': m.experiment, 'kind': m.kind, 'label': m.label}
                | m.residuals.figures()
                for m in self.misfits
            ],
            'regions': [region.to_dict() for region in self.regions],
            'dependences': [asdict(dependence) for dependence in self.dependences],
            'notes': [*self.warnings, *self.study.notes],
        }


@dataclass(frozen=True)
class SideBySide:
    """Several models beside the same readings.

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
    readings = Residuals(
        campaign.readings.thickness_um,
        points.predicted_um[campaign.means.owner],
        study.noise.sigma_um,
    )
    dependences = []
    for covariate in study.covariates(model):
        if covariate.varies:
            found = rank_correlation(covariate.values, points.residual_um)
            dependences.append(Dependence(covariate.name, *found))
    return Comparison(
        study,
        readings,
        points,
        tuple(_misfits(study, model, readings)),
        tuple(sorted(dependences, key=lambda d: d.p_value)),
        tuple(misfit_regions(study, points, model)),
        model,
    )


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
