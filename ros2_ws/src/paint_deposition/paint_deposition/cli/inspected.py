"""What `inspect` says of gauge readings and of a mesh: figures, and the same in words."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import paint_deposition as pd
from paint_deposition.cli import options
from paint_deposition.errors import some

MOST_NAMED = 8


def readings_in(path: Path, points_file: Path | None) -> tuple[dict[str, Any], str]:
    """The readings of a table: how many, where, of what film, their zeros and repeats."""
    import numpy as np

    from paint_deposition.inference.readings.gauge_noise import gauge_noise
    from paint_deposition.inference.readings.readings import PointMeans
    from paint_deposition.part.points import box_words

    readings = pd.read_readings(path, points_file)
    # A point that is read in two layers is two points.
    named = zip(readings.point, readings.layer, strict=True)
    places = [f'{point}, {layer}' if layer else point for point, layer in named]
    readings = replace(readings, point=np.array(places))
    film, means, noise = readings.thickness_um, PointMeans.of(readings), gauge_noise(readings)
    zeros, repeated = (
        list(dict.fromkeys(readings.point[rows].tolist()))
        for rows in (film == 0.0, (means.repeats > 1)[means.owner])
    )
    low, high = readings.positions_m.min(axis=0), readings.positions_m.max(axis=0)
    warnings = [*readings.doubts]
    if zeros:
        warnings.append(
            f'{np.count_nonzero(film == 0.0)} readings are 0 (points {some(zeros, MOST_NAMED)}): '
            'bare metal, or not measured; write n/a for the latter, or say zero: in the campaign'
        )
    options.print_all('warning', warnings)
    figures = {
        'readings': len(readings), 'points': len(means.first), 'zeros': zeros,
        'repeated': repeated, 'noise_um': noise.typical_um, 'noise_source': noise.source,
        'mean_um': film.mean(), 'min_um': film.min(), 'max_um': film.max(),
        'low_m': low.tolist(), 'high_m': high.tolist(), 'notes': [readings.understood],
        'warnings': warnings,
    }  # fmt: skip
    repeats = f'{len(repeated)} of them measured again' if repeated else 'none measured again'
    lines = [
        readings.understood,
        f'{len(readings)} readings at {len(means.first)} points, {repeats}: noise of the gauge '
        f'{noise.typical_um:.2f} µm, {noise.source}',
        f'film {film.min():.1f} to {film.max():.1f} µm, mean {film.mean():.1f} µm',
        box_words(readings.positions_m),
    ]
    return figures, '\n'.join(lines)


def mesh_in(path: Path) -> tuple[dict[str, Any], str]:
    """A mesh: its size in the unit that it has, or seems to have, and its bodies."""
    import numpy as np

    from paint_deposition.files.mesh_bodies import WITH_UNIT, read_bodies
    from paint_deposition.files.meshes import LARGEST_M
    from paint_deposition.part.points import box_words

    ((vertices, faces), *_), scale, unit = read_bodies(path), 1.0, ''
    if path.suffix.lower() not in WITH_UNIT:
        unit = 'it has no unit and is taken for metres'
        largest = float(np.ptp(vertices, axis=0).max()) if len(vertices) else 0.0
        if largest > LARGEST_M:
            scale, unit = 1e-3, (
                f'it has no unit and looks like millimetres, else it would be {largest:.4g} m '
                'large: give --mesh-scale 0.001'
            )  # fmt: skip
    surface = pd.read_mesh(path, scale, LARGEST_M)
    low, high = surface.vertices_m.min(axis=0), surface.vertices_m.max(axis=0)
    area_m2 = float(surface.vertex_areas_m2.sum())
    figures = {
        'triangles': len(faces), 'low_m': low.tolist(), 'high_m': high.tolist(),
        'area_m2': area_m2, 'mesh_scale': scale, 'notes': list(surface.notes),
    }  # fmt: skip
    size = ' x '.join(f'{side:.3f}' for side in high - low)
    what = f'{path.name}: a mesh of {len(faces)} triangles, {size} m, {area_m2:.3g} m2'
    return figures, '\n'.join(
        filter(None, [what, unit, box_words(surface.vertices_m), *surface.notes])
    )
