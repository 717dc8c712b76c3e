"""The model beside the readings: where and how much it is off."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, spearmanr

from paint_deposition.comparison.regions import Region, misfit_regions
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.fitting.study import Study


@dataclass(frozen=True)
class Misfit:
    """How far the model is off on some of the readings; residual = measured minus predicted.

    Attributes:
        experiment, kind, label: which readings: kind is 'experiment', 'group' or 'pass'.
        readings: how many.
        bias_um, rmse_um, std_um: mean, root mean square and standard deviation of residuals.
        chi_square_per_reading: about 1 where only the gauge's noise is left.
        p_value: that noise alone gives this chi-square.
    """

    experiment: str
    kind: str
    label: str
    readings: int
    bias_um: float
    rmse_um: float
    std_um: float
    chi_square_per_reading: float
    p_value: float


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
        predicted_um, residual_um, sigma_um: (N,) of every reading used, experiments in order.
        misfits: of each experiment, its groups and its passes.
        dependences: strongest first.
        regions: where the misfit is significant, strongest first.
        noise_source: where the gauge's noise is known from.
        noise_um: standard deviation of a reading.
        notes: remarks for the user.
    """

    predicted_um: np.ndarray
    residual_um: np.ndarray
    sigma_um: np.ndarray
    misfits: tuple[Misfit, ...]
    dependences: tuple[Dependence, ...]
    regions: tuple[Region, ...]
    noise_source: str
    noise_um: float
    notes: tuple[str, ...]


def compare(study: Study, model: DepositionModel) -> Comparison:
    """Predict every reading and sum up the misfit."""
    at_points = study.forward.predict_um(model)
    owner, start = [], 0
    for experiment in study.campaign.experiments:
        owner.append(experiment.means.owner + start)
        start += len(experiment)
    owner = np.concatenate(owner)
    measured = np.concatenate([e.readings.thickness_um for e in study.campaign.experiments])
    predicted = at_points[owner]
    residual, sigma = measured - predicted, study.noise.sigma_um
    off = study.measured_um - at_points
    dependences = []
    for covariate in study.covariates(model):
        if covariate.varies:
            correlation, p_value = spearmanr(covariate.values, off)
            dependences.append(Dependence(covariate.name, float(correlation), float(p_value)))
    return Comparison(
        predicted,
        residual,
        sigma,
        tuple(_misfits(study, model, owner, residual, sigma)),
        tuple(sorted(dependences, key=lambda d: d.p_value)),
        tuple(misfit_regions(study, off, study.sigma_um, model)),
        study.noise.source,
        study.noise.typical_um,
        study.notes,
    )


def _misfits(
    study: Study,
    model: DepositionModel,
    owner: np.ndarray,
    residual: np.ndarray,
    sigma: np.ndarray,
) -> Iterator[Misfit]:
    passes = study.bands(model)
    labels_of_pass = _pass_labels(study, model)
    start = 0
    for index, experiment in enumerate(study.campaign.experiments):
        rows = np.arange(start, start + len(experiment.readings))
        start += len(experiment.readings)
        yield _misfit(experiment.name, 'experiment', experiment.name, rows, residual, sigma)
        for label in dict.fromkeys(experiment.readings.group):
            if label:
                inside = rows[experiment.readings.group == label]
                yield _misfit(experiment.name, 'group', str(label), inside, residual, sigma)
        here = np.unique(passes[study.experiment_of == index])
        for band in here if len(here) > 1 else ():
            inside = rows[passes[owner[rows]] == band]
            label = f'pass {labels_of_pass[band]}'
            yield _misfit(experiment.name, 'pass', label, inside, residual, sigma)


def _pass_labels(study: Study, model: DepositionModel) -> dict[int, int]:
    """Number, from 1, of the pass that each band belongs to."""
    values = next(c for c in study.covariates(model) if c.name == 'spray_pass').values
    return {
        band: int(round(float(value))) + 1
        for band, value in zip(study.bands(model), values, strict=True)
    }


def _misfit(
    experiment: str,
    kind: str,
    label: str,
    rows: np.ndarray,
    residual: np.ndarray,
    sigma: np.ndarray,
) -> Misfit:
    here, relative = residual[rows], residual[rows] / sigma[rows]
    square = float(relative @ relative)
    return Misfit(
        experiment,
        kind,
        label,
        len(rows),
        float(here.mean()),
        float(np.sqrt(np.mean(here**2))),
        float(here.std(ddof=1)) if len(rows) > 1 else 0.0,
        square / len(rows),
        float(chi2.sf(square, len(rows))),
    )
