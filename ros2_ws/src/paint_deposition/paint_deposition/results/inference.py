"""Results of comparing and diagnosing as JSON and CSV; names as others rely on them."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from paint_deposition.comparison.comparison import Comparison
from paint_deposition.comparison.regions import Region
from paint_deposition.diagnosis.next_experiment import Place, Spray
from paint_deposition.diagnosis.verdict import Diagnosis
from paint_deposition.files.gauge_readings import write_table
from paint_deposition.fitting.study import Study


def comparison_as_dict(comparison: Comparison) -> dict[str, Any]:
    """The figures of a comparison."""
    study = comparison.study
    return {
        'readings': len(comparison.readings),
        'noise': {'sigma_um': study.noise.typical_um, 'source': study.noise.source},
        'misfits': [
            {'experiment': m.experiment, 'kind': m.kind, 'label': m.label, **m.residuals.figures()}
            for m in comparison.misfits
        ],
        'regions': regions_as_list(comparison.regions),
        'dependences': [asdict(dependence) for dependence in comparison.dependences],
        'notes': list(study.notes),
    }


def regions_as_list(regions: Sequence[Region]) -> list[dict[str, Any]]:
    """Regions of misfit, strongest first."""
    return [
        {
            'description': region.description,
            'experiment': region.experiment,
            'readings': region.readings,
            'mean_residual_um': region.mean_residual_um,
        }
        for region in regions
    ]


def diagnosis_as_dict(
    diagnosis: Diagnosis,
    regions: Sequence[Region],
    places: Sequence[Place] = (),
    sprays: Sequence[Spray] = (),
) -> dict[str, Any]:
    """The content of ``diagnosis.json``."""
    before, after = diagnosis.history[0], diagnosis.history[-1]
    return {
        'verdict': diagnosis.verdict,
        'reason': diagnosis.reason,
        'p_value': diagnosis.p_value,
        'accepted': list(diagnosis.accepted),
        'classes': [
            {
                'members': list(c.members),
                'probability': c.probability,
                'best': c.best,
                'parameters': {name: asdict(value) for name, value in c.parameters.items()},
                'holdout_rmse_um': c.holdout_rmse_um,
            }
            for c in diagnosis.classes
        ],
        'rmse_um': {
            'before': before.rmse_um,
            'after': after.rmse_um,
            'holdout_before': before.holdout_rmse_um,
            'holdout_after': after.holdout_rmse_um,
            'noise_floor': diagnosis.noise_floor_um,
        },
        'unknown': None if diagnosis.unknown is None else asdict(diagnosis.unknown),
        'not_testable': list(diagnosis.not_testable),
        'detectable': diagnosis.detectable,
        'regions': regions_as_list(regions),
        'next': {
            'measure': [_place(place) for place in places],
            'spray': [
                {
                    'what': spray.what,
                    'separates': list(spray.separates),
                    'separation_sigma': spray.separation,
                    'separation_now_sigma': spray.now,
                }
                for spray in sprays
            ],
        },
        'noise': {
            'sigma_um': diagnosis.study.noise.typical_um,
            'source': diagnosis.study.noise.source,
        },
        'notes': list(diagnosis.notes),
    }


def write_residuals(path: str | Path, study: Study, comparison: Comparison) -> None:
    """Write a row a reading: where, measured, predicted, residual and its uncertainty.

    Readings that were left out are there, too, without a prediction.
    """
    lines = [
        ['experiment', 'point', 'group', 'x_m', 'y_m', 'z_m', 'thickness_um', 'predicted_um',
         'residual_um', 'sigma_um', 'used']
    ]  # fmt: skip
    found = comparison.readings
    fitted = zip(found.predicted_um, found.residual_um, found.sigma_um, strict=True)
    for experiment in study.campaign.experiments:
        readings = experiment.taken
        for k, used in enumerate(experiment.used):
            lines.append(
                [
                    experiment.name,
                    str(readings.point[k]),
                    str(readings.group[k]),
                    *(f'{value:.5f}' for value in readings.positions_m[k]),
                    f'{readings.thickness_um[k]:.3f}',
                    *([f'{value:.3f}' for value in next(fitted)] if used else [''] * 3),
                    str(int(used)),
                ]
            )
    write_table(path, lines)


def _place(place: Place) -> dict[str, Any]:
    x, y, z = (float(value) for value in place.position_m)
    return {'experiment': place.experiment, 'x_m': x, 'y_m': y, 'z_m': z, 'why': place.why}
