"""How a film is written."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from paint_deposition.api.simulation import Film
from paint_deposition.api.writers.provenance import with_provenance
from paint_deposition.files.gauge_readings import write_predictions
from paint_deposition.report.drawing import HERE, DrawingProcess, Here
from paint_deposition.report.writers.film import write_film, write_film_table

PNG = 'png'


def film(
    result: Film,
    folder: str | Path,
    made_from: Mapping[str, Any] | None = None,
    pictures: str = PNG,
    drawing: DrawingProcess | Here = HERE,
    parquet: bool = False,
) -> list[Path]:
    models = {gun.name or 'model': gun.model for gun in result.guns}
    motions = {f'{gun.name}: trajectory': gun.trajectory.source for gun in result.guns if gun.name}
    there = {what: file for what, file in motions.items() if Path(file).exists()}
    about = with_provenance(result.to_dict() | dict(made_from or {}), models, there)
    names = [Path(about.get(key, '')).name for key in ('mesh_file', 'trajectory', 'model_file')]
    picture = drawing.start(
        'film:write_film_picture', Path(folder) / f'film.{pictures}', result.surface,
        result.film_um, result.path, result.statistics, f'Film on {names[0] or "the part"}',
        f'{names[1]}, {names[2] or "default model"}',
    )  # fmt: skip
    files = write_film(
        folder, result.surface, result.film_um, result.statistics, details=about, overwrite=True
    )
    if parquet:
        table = Path(folder) / 'film.parquet'
        files.append(write_film_table(table, result.surface, result.film_um))
    if result.readings is not None and result.predicted_um is not None:
        files.append(Path(folder) / 'predicted.csv')
        write_predictions(files[-1], result.readings, result.predicted_um)
    return [*files, picture.result()]
