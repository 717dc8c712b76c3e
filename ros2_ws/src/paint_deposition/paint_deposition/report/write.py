"""One function that writes every result, one that draws it, and films on disk."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import singledispatch
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import PaintError
from paint_deposition.files.atomic import replacing, write_json
from paint_deposition.files.gauge_readings import table_text, write_predictions
from paint_deposition.files.meshes import write_mesh_ply
from paint_deposition.files.provenance import origin
from paint_deposition.film.film import Film
from paint_deposition.film.statistics import FilmStatistics
from paint_deposition.part.surface import Surface
from paint_deposition.part.zones import Zones
from paint_deposition.report.colour_scales import film_scale

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Modules beside this one that register writers; those that import least come first.
WRITERS = ('write_plans', 'write_inference')


@singledispatch
def written(result: Any, folder: Path, **more: Any) -> list[Path]:
    """Write a result of the first argument's type to an existing folder; the paths."""
    raise TypeError(f'{type(result).__name__} is not a result that can be written')


def write(result: Any, folder: str | Path, **more: Any) -> list[Path]:
    """Write a result as its command does, replacing older files of the same names.

    Args:
        result: what a verb of this package returned.
        folder: made if it is not there.
        pictures: format of the pictures, 'png', 'svg' or 'pdf'.
        start: of a calibration or a diagnosis, the ``ModelFile`` that it started from: its name,
            history and uncertainties are carried on.
        made_from: of a film, a plan, an improvement, chosen points or a recommendation, more to
            say in its figures, such as the files used.
        model: of a recommendation, what it was computed with.
        part_pose, frame_id: of a plan or an improvement, where the part stands in the robot's
            frame, [x y z qx qy qz qw], and the name of that frame; its files have their poses in
            that frame then. The first of them also of chosen points.
        paint_moves: of a plan or an improvement, whether its RAPID module sprays by PaintL with
            SetBrush instead of by MoveL with an output.

    Returns:
        The paths written.

    Raises:
        PaintError: the folder cannot be written.
    """
    for module in WRITERS:
        if type(result) in written.registry:
            break
        import_module(f'{__package__}.{module}')
    folder = Path(folder)
    with writable(folder):
        folder.mkdir(parents=True, exist_ok=True)
        return written(result, folder, **more)


def plot(result: Any, ax: 'Axes | None' = None) -> 'Axes':
    """Draw a result: a film, a plan or points on their part, a curve, or measured over predicted.

    Args:
        result: what a verb of this package returned.
        ax: where to draw; default: matplotlib's present axes.

    Returns:
        The axes, for titles and more.
    """
    from paint_deposition.inference.comparison.comparison import Comparison
    from paint_deposition.inference.design.reading_choice import ChosenReadings
    from paint_deposition.inference.diagnosis.verdict import Diagnosis
    from paint_deposition.inference.fitting.calibration import Calibration
    from paint_deposition.planning.faces import PartPlan
    from paint_deposition.planning.plan import Plan
    from paint_deposition.planning.recommendation import Recommendation
    from paint_deposition.report.drawing import PartPicture
    from paint_deposition.report.film_pictures import draw_film
    from paint_deposition.report.plan_pictures import draw_curve
    from paint_deposition.report.readings_pictures import draw_agreement, draw_points

    if ax is None:
        from matplotlib import pyplot

        ax = pyplot.gca()
    if isinstance(result, Film | Plan | PartPlan):
        above_um = result.statistics.painted_above_um
        draw_film(ax, PartPicture.of(result.surface), result.film_um, result.path, above_um)
    elif isinstance(result, ChosenReadings):
        draw_points(ax, result, PartPicture.of(result.surface))
    elif isinstance(result, Recommendation):
        draw_curve(ax, result)
    elif isinstance(result, Calibration):
        study = result.study
        draw_agreement(ax, study.measured_um, result.fit.predicted_um, study.sigma_um)
    elif isinstance(result, Comparison | Diagnosis):
        of = result.comparisons[-1] if isinstance(result, Diagnosis) else result
        found = of.readings
        draw_agreement(ax, found.measured_um, found.predicted_um, found.sigma_um)
    else:
        raise TypeError(f'{type(result).__name__} is not a result that can be drawn')
    return ax


@contextmanager
def writable(folder: Path) -> Iterator[None]:
    """Give PaintError for what keeps files from being written to a folder."""
    try:
        yield
    except OSError as error:
        raise PaintError(
            f'{error.filename or folder}: {error.strerror}; choose a folder that can be written'
        ) from None


def with_provenance(
    made_from: Mapping[str, Any],
    model: DepositionModel | Mapping[str, DepositionModel] | None,
    more_files: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    """The entries with the provenance of their result: the model and the input files."""
    keys = ('mesh_file', 'trajectory', 'model_file', 'zones_file')
    named = {key.removesuffix('_file'): str(made_from[key]) for key in keys if made_from.get(key)}
    files = {what: file for what, file in named.items() if Path(file).exists()}
    files |= dict(more_files or {})
    return {**made_from, 'provenance': origin(model, files)}


@written.register
def _write_simulation(
    result: Film, folder: Path, made_from: Mapping[str, Any] | None = None, pictures: str = 'png'
) -> list[Path]:
    from paint_deposition.report.drawing import save_picture
    from paint_deposition.report.film_pictures import film_picture

    models = {gun.name or 'model': gun.model for gun in result.guns}
    motions = {f'{gun.name}: trajectory': gun.trajectory.source for gun in result.guns if gun.name}
    found = {what: file for what, file in motions.items() if Path(file).exists()}
    about = with_provenance(result.to_dict() | dict(made_from or {}), models, found)
    files = write_film(
        folder, result.surface, result.film_um, result.statistics, zones=result.zones,
        coats_um={coat.name: coat.film_um for coat in result.coats}, details=about,
        overwrite=True,
    )  # fmt: skip
    if result.readings is not None and result.predicted_um is not None:
        files.append(folder / 'predicted.csv')
        write_predictions(files[-1], result.readings, result.predicted_um)
    mesh, motion, model = (
        ', '.join(Path(file).name for file in str(about.get(key, '')).split(', '))
        for key in ('mesh_file', 'trajectory', 'model_file')
    )
    picture = film_picture(
        result.surface, result.film_um, result.path, result.statistics,
        f'Film on {mesh or "the part"}',
        ', '.join(filter(None, [motion, model or 'default model'])), result.zones,
    )  # fmt: skip
    return [*files, save_picture(picture, folder / f'film.{pictures}')]


def write_film(
    folder: str | Path,
    surface: Surface,
    film_um: np.ndarray,
    statistics: FilmStatistics,
    *,
    coats_um: Mapping[str, np.ndarray] | None = None,
    zones: Zones | None = None,
    stem: str = 'film',
    statistics_file: str = 'stats.json',
    details: Mapping[str, Any] | None = None,
    color_range_um: tuple[float, float] = (0.0, 0.0),
    overwrite: bool = False,
) -> list[Path]:
    """Write ``<stem>.ply``, ``<stem>.csv`` and the statistics, each file whole or not at all.

    Args:
        folder: where to; made if it is not there.
        film_um: (V,) film at the vertices of the surface [um].
        coats_um: (V,) what each coat adds to the film [um], by name: further columns.
        zones: of the vertices; their names are a column of the table.
        details: more to say in the statistics, such as counts of poses and the files used.
        color_range_um: ends of the colour map in the PLY [um]; both 0 is automatic.

    Raises:
        PaintError: a file of that name is there, or the folder cannot be written.
    """
    folder = Path(folder).expanduser().absolute()
    paths = [folder / f'{stem}.ply', folder / f'{stem}.csv', folder / statistics_file]
    for path in paths:
        if path.exists() and not overwrite:
            raise PaintError(
                f'{path} is there already; choose another name, or move the old file away'
            )
    shown = film_um > statistics.painted_above_um
    colours = film_scale(film_um, *color_range_um).rgba(film_um, shown)
    films = {'thickness_um': film_um}
    films |= {f'{name}_um': coat_um for name, coat_um in (coats_um or {}).items()}
    columns = dict(zip(('x_m', 'y_m', 'z_m'), surface.vertices_m.T, strict=True)) | films
    with writable(folder):
        try:
            write_mesh_ply(paths[0], surface, colours, **films)
            _write_table(paths[1], columns, zones.names if zones else None)
            write_json(paths[2], {**statistics.to_dict(), **(details or {})})
        except OSError:
            for path in () if overwrite else paths:
                path.unlink(missing_ok=True)
            raise
    return paths


def _write_table(path: Path, columns: Mapping[str, np.ndarray], names: np.ndarray | None) -> None:
    """Columns (V,) of numbers by heading, and the zones' names (V,) as the last one, if any."""
    rows = np.column_stack([*columns.values()])
    heading, form = [*columns], ','.join(['%.9g'] * len(columns))
    if names is not None:
        each, of = np.unique(names, return_inverse=True)
        fields = [name and table_text([[name]]).removesuffix('\n') for name in each]
        rows = np.column_stack([rows.astype(object), np.array(fields)[of]])
        heading, form = [*heading, 'zone'], f'{form},%s'
    with replacing(path) as temporary, temporary.open('w', encoding='utf-8') as file:
        file.write(table_text([heading]))
        # So many rows formatted together take half the time.
        for some in np.split(rows, range(10_000, len(rows), 10_000)):
            file.write(f'{form}\n' * len(some) % tuple(some.ravel().tolist()))
