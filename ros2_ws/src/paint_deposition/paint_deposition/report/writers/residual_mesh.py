"""The part coloured by how far the model is off, one PLY an experiment."""

import re
from pathlib import Path

import numpy as np

from paint_deposition.files.meshes import write_mesh_ply
from paint_deposition.film.colour_scales import residual_scale
from paint_deposition.inference.comparison.comparison import Comparison
from paint_deposition.inference.comparison.residual_field import spread_over_surface


def write_residual_meshes(folder: str | Path, comparison: Comparison) -> list[Path]:
    """Write ``residual_<experiment>.ply``: vertex colours and property ``residual_um``.

    Residual = measured minus predicted, interpolated between readings; grey and NaN where no
    reading is near. All experiments share one scale of colours.
    """
    campaign = comparison.study.campaign
    fields = []
    for number, experiment in enumerate(campaign.experiments):
        at = experiment.measured_points
        residual_um = comparison.points.residual_um[campaign.experiment_of == number]
        surface = experiment.surface
        fields.append(spread_over_surface(surface, at.positions_m, at.normals, residual_um))
    everything = np.concatenate(fields)
    scale = residual_scale(everything[np.isfinite(everything)])
    paths: list[Path] = []
    for experiment, field in zip(campaign.experiments, fields, strict=True):
        path = Path(folder) / f'residual_{file_name(experiment.name)}.ply'
        if path in paths:
            path = path.with_stem(f'{path.stem}_{len(paths) + 1}')
        colours = scale.rgba(field, np.isfinite(field))
        write_mesh_ply(path, experiment.surface, colours, residual_um=field)
        paths.append(path)
    return paths


def file_name(name: str) -> str:
    """An experiment's name without what file systems do not like."""
    return re.sub(r'[^\w.-]+', '_', name).strip('._') or 'experiment'
