"""The results of a command, on the live page."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import trimesh
from pydantic import BaseModel, ValidationError

from paint_deposition.api.inference import compare, compare_models
from paint_deposition.effects.catalogue import load_unnamed_effect_file
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import LONGEST_QUOTED, PaintError
from paint_deposition.files.atomic import read_file, require_file
from paint_deposition.files.campaign_file import read_campaign
from paint_deposition.files.model_file import model_of, read_model
from paint_deposition.files.provenance import model_digest, sha256
from paint_deposition.film.colour_scales import film_scale, residual_scale
from paint_deposition.film.statistics import DEFAULT_PAINTED_ABOVE_UM, film_statistics
from paint_deposition.inference.comparison.comparison import Comparison, SideBySide
from paint_deposition.part.surface import Surface
from paint_deposition.report.data import ReportData
from paint_deposition.report.live.page import Scene

DIAGNOSIS, COMPARISON, FILM = 'diagnosis.json', 'comparison.json', 'film.ply'

Written = TypeVar('Written', bound=BaseModel)


class _File(BaseModel):
    what: str
    file: str
    sha256: str


class _MadeFrom(BaseModel):
    campaign: str
    models: dict[str, dict[str, Any]] = {}
    files: list[_File]


class _Figures(BaseModel):
    """What is needed to paint the parts of a comparison or a diagnosis again."""

    accepted: list[str] = []
    provenance: _MadeFrom


class _Statistics(BaseModel, allow_inf_nan=False):
    """What is shown beside a film."""

    mesh_file: str = ''
    down: tuple[float, float, float] = (0.0, 0.0, -1.0)
    painted_above_um: float = DEFAULT_PAINTED_ABOVE_UM
    target_um: float = 0.0
    target_tolerance_um: float = 0.0
    mean_um: float | None = None
    std_dev_um: float | None = None
    min_um: float | None = None
    max_um: float | None = None
    coverage: float | None = None
    within_target: float | None = None
    painted_volume_cm3: float | None = None
    capture_fraction: float | None = None


def is_results(folder: Path) -> bool:
    """Whether a folder holds results that can be shown."""
    return any((folder / name).is_file() for name in (DIAGNOSIS, COMPARISON, FILM))


def results_scenes(folder: Path) -> tuple[list[Scene], list[str]]:
    """The scenes of a folder of results, best model first, and warnings.

    Of a comparison or a diagnosis each part is painted with each model, and its readings are
    predicted, from the campaign that the results were made from. Other films are shown as written.

    Raises:
        PaintError: what the results were made from is not there, or cannot be read.
    """
    if (folder / DIAGNOSIS).is_file():
        figures = _read(_Figures, folder / DIAGNOSIS)
        after = ' + '.join(['after', *figures.accepted])
        models = {
            'before': read_model(folder / 'model_before.yaml', load_unnamed_effect_file),
            after: read_model(folder / 'model.yaml', load_unnamed_effect_file),
        }
    elif (folder / COMPARISON).is_file():
        figures = _read(_Figures, folder / COMPARISON)
        described = figures.provenance.models.items()
        models = {name: _model(folder, name, values) for name, values in described}
    else:
        return [_written_film(folder)], []
    path = Path(figures.provenance.campaign)
    if not path.is_file():
        raise PaintError(
            f'{folder}: its campaign {path} is not there; run the command in the folder in which '
            'the results were made'
        )
    files = figures.provenance.files
    changed = [f.file for f in files if not Path(f.file).exists() or sha256(f.file) != f.sha256]
    warnings = [f'{file} is not what {folder} was made from' for file in changed]
    campaign = read_campaign(path)
    if len(models) == 1:
        ((name, model),) = models.items()
        return _scenes({name: compare(campaign, model)}), warnings
    return _scenes(compare_models(campaign, models).by_name), warnings


def _scenes(by_model: Mapping[str, Comparison]) -> list[Scene]:
    """Each part with each model, the last model first."""
    data = ReportData.of(SideBySide(by_model))
    scenes = []
    for row, (experiment, painted) in enumerate(zip(data.experiments, data.painted, strict=True)):
        wanted = data.study.campaign.target_of(experiment)
        films = [film_um for film_um, _ in painted]
        at = data.rows_of(row)
        residuals = [comparison.points.select(at) for comparison in data.comparisons]
        span = residual_scale(np.concatenate([found.residual_um for found in residuals]))
        errors = [
            {'model': name, 'rmse_um': found.rmse_um}
            for name, found in zip(data.names, residuals, strict=True)
        ]
        of_models = [*zip(data.names, painted, residuals, strict=True)]
        for name, (film_um, emitted_cm3), found in of_models[::-1]:
            scene = Scene(experiment.name, name)
            scene.show_part(experiment.surface)
            scene.tell('about', text=experiment.name)
            scene.show_scale(film_scale(np.concatenate(films)), DEFAULT_PAINTED_ABOVE_UM, *wanted)
            scene.show_film(film_um)
            figures = film_statistics(
                film_um, experiment.surface.vertex_areas_m2, emitted_cm3,
                target_um=wanted[0], target_tolerance_um=wanted[1],
                zones=experiment.zones,
            )  # fmt: skip
            scene.add_figures(0.0, figures, found.rmse_um)
            arrays = {
                'positions': experiment.measured_points.positions_m,
                'measured': found.measured_um,
                'predicted': found.predicted_um,
            }
            scene.tell(
                'readings',
                {name: values.astype(np.float32) for name, values in arrays.items()},
                names=experiment.readings.point[experiment.means.first].tolist(),
                errors=errors, span=span.high, noise=data.study.noise.typical_um,
            )  # fmt: skip
            scenes.append(scene)
    return scenes


def _written_film(folder: Path) -> Scene:
    """The film that a command wrote, with its figures."""
    require_file(folder / FILM, PaintError)
    try:
        mesh = trimesh.load_mesh(folder / FILM, process=False)
        film_um = mesh.metadata['_ply_raw']['vertex']['data']['thickness_um']
    except Exception as error:  # trimesh raises whatever the broken bytes provoke
        reason = ' '.join(str(error).split())[:LONGEST_QUOTED]
        raise PaintError(f'{folder / FILM} is no film ({reason}); make it again') from None
    written = folder / 'stats.json'
    figures = _read(_Statistics, written) if written.is_file() else _Statistics()
    surface = Surface(
        np.asarray(mesh.vertices, float), np.asarray(mesh.faces), np.asarray(mesh.vertex_normals),
        np.ones(len(mesh.vertices)), np.array(figures.down),
    )  # fmt: skip
    scene = Scene()
    scene.show_part(surface)
    scene.tell('about', text=Path(figures.mesh_file or folder).name)
    scene.show_scale(
        film_scale(film_um), figures.painted_above_um, figures.target_um,
        figures.target_tolerance_um,
    )  # fmt: skip
    scene.show_film(film_um)
    if figures.mean_um is not None:
        scene.add_figures(0.0, figures)
    return scene


def _model(folder: Path, name: str, values: dict[str, Any]) -> DepositionModel:
    """The model that a comparison says it was made with."""
    model = model_of({key: value for key, value in values.items() if key != 'sha256'})
    if model_digest(model) != values.get('sha256'):
        raise PaintError(
            f'{folder}: its {COMPARISON} does not describe the model {name} in full; compare again'
        )
    return model


def _read(kind: type[Written], path: Path) -> Written:
    try:
        return kind.model_validate_json(read_file(path, PaintError))
    except ValidationError as error:
        first = error.errors()[0]
        where = '.'.join(map(str, first['loc'])) or 'JSON'
        reason = f'{where}: {first["msg"]}'
        raise PaintError(f'{path} is not as paint writes it ({reason}); make it again') from None
