"""Campaign files: which parts were painted along which recording and measured where."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import numpy as np
from pydantic import AfterValidator, BaseModel, Field, model_validator

from paint_deposition.errors import PaintError, ReadingsError
from paint_deposition.files.atomic import read_yaml
from paint_deposition.files.campaign_coats import (
    PaintJob,
    dried,
    laid_coats,
    laid_path,
    solids_of,
    with_brush,
)
from paint_deposition.files.gauge_readings import read_readings
from paint_deposition.files.meshes import read_mesh
from paint_deposition.files.motion_files import read_motion
from paint_deposition.files.tables.headings import LENGTHS, unit_of
from paint_deposition.files.tables.reading_columns import Layout
from paint_deposition.files.zones_file import read_zones
from paint_deposition.film.common_film import TOTAL
from paint_deposition.film.statistics import require_band
from paint_deposition.inference.readings.campaign import Campaign, Experiment
from paint_deposition.motion.path_builder import checked_path
from paint_deposition.part.surface import toward_the_guns
from paint_deposition.request import Name, Number, OnePart, Text, validate

Quantity = Literal[
    'x', 'y', 'z', 'from_left', 'height', 'thickness', 'point', 'group', 'session', 'layer',
    'layers',
]  # fmt: skip
Column = Text | int | list[Text | int] | dict[Text, Text | int]
Unit = Literal['m', 'mm', 'cm', 'inch', 'um', 'µm', 'mil']
_QUANTITIES = ', '.join(name for name in get_args(Quantity) if name != 'layers')
# Called with 'note' or 'warning', the name of an experiment and a line on it.
Remark = Callable[[Literal['note', 'warning'], str, str], None]
# Keys for the head of the report only.
HEAD = ('part', 'batch', 'paint', 'cell', 'date', 'operator')


class _Band(BaseModel):
    """The film wanted, and what it may differ."""

    target_um: Number | None = Field(None, gt=0.0, description='the film wanted, above 0 [um]')
    tolerance_um: Number | None = Field(
        None, gt=0.0, description='what the film may differ from target_um, above 0 [um]'
    )

    @model_validator(mode='after')
    def _check(self) -> '_Band':
        if (self.target_um is None) != (self.tolerance_um is None):
            raise ValueError('target_um and tolerance_um belong together; give both or none')
        try:
            require_band(self.target_um or 0.0, self.tolerance_um or 0.0)
        except PaintError as error:
            raise ValueError(str(error)) from None
        return self


class _File(_Band, extra='forbid'):
    """A campaign as it is written."""

    experiments: list[Any] = Field(min_length=1, description='a list of at least one experiment')
    model: Text | None = Field(None, description='the name of a model file')
    part: Name = ''
    batch: Name = ''
    paint: Name = ''
    cell: Name = ''
    date: Name = ''
    operator: Name = ''
    zones: Text | None = Field(None, description='the name of a zones file')


def _columns(columns: dict[str, Any]) -> dict[str, Any]:
    for quantity, said in columns.items():
        if isinstance(said, dict) != (quantity == 'layers'):
            raise ValueError(
                "give 'layers' the columns by the names of the layers, others a column"
            )
        if isinstance(said, list) and quantity != 'thickness':
            raise ValueError(f'{quantity} has one column; only thickness may have a list of them')
    return columns


class _Entry(PaintJob, OnePart, _Band):
    """An experiment as it is written; paths are relative to the campaign's file."""

    mesh: Text = Field(description='the name of a mesh file')
    measurements: Text = Field(description='the name of a file of gauge readings')
    coats: list[Any] = Field(
        [], description='a list of coats in the order of painting, each with its name'
    )
    wet: bool = Field(
        False, description='true or false, whether the readings are of wet film, which solids dry'
    )
    under_um: Number = Field(
        0.0, ge=0.0, description='film that was there before, part of all total readings [um]'
    )
    zones: Text | None = Field(None, description="the name of a zones file, if not the campaign's")
    points: Text | None = Field(None, description='the name of a file of measuring points')
    columns: Annotated[dict[Quantity, Column], AfterValidator(_columns)] = Field(
        {},
        description=f'the heading, or the number from 1, of the column of {_QUANTITIES}; of '
        "thickness also a list; of layers by their names; 'none' for a quantity that there is not",
    )
    unit: dict[Literal['position', 'thickness'], Unit] = Field(
        {}, description='position: m, mm, cm or inch, and thickness: um, mil or mm'
    )
    decimal: Literal['comma', 'point'] | None = Field(
        None, description="'comma' or 'point', how the readings' numbers are written"
    )
    sheet: Text | None = Field(None, description="the name of a workbook's sheet")
    zero: Literal['missing', 'film'] | None = Field(
        None, description="'missing' or 'film', what a reading of 0 is"
    )
    switched_off: list[Literal['voltage', 'draught']] = Field(
        [], description="a list of what the cell had switched off, of 'voltage' and 'draught'"
    )


def read_campaign(
    path: str | Path,
    progress: Callable[[str], None] = lambda line: None,
    part_pose: Sequence[float] | None = None,
    remark: Remark = lambda kind, experiment, line: None,
    zones: str | Path | None = None,
) -> Campaign:
    """Read a campaign with all that it names; paths in it are relative to it.

    Args:
        progress: called with a line for each experiment.
        part_pose: [x y z qx qy qz qw] of the part in the frame of the poses, for every experiment
            that has none of its own.
        remark: called with 'note' or 'warning', the experiment's name and what is odd about it.
        zones: file of zones for every experiment, in place of those that the campaign names.

    Raises:
        PaintError: naming the file, the experiment and the key at fault, and the remedy.
    """
    path = Path(path)
    content = read_yaml(path, 'campaign', ReadingsError)
    file = validate(_File, f'{path}: campaign', content, ReadingsError)
    experiments: list[Experiment] = []
    names: list[str] = []
    for number, written in enumerate(file.experiments, start=1):
        entry = validate(_Entry, f'{path}: experiment {number}', written, ReadingsError)
        name = entry.name or f'experiment_{number}'
        if name in names:
            raise ReadingsError(f"{path}: two experiments are called '{name}'; rename one")
        names.append(name)
        progress(f'reading {name}')
        if part_pose is not None and entry.part_pose is None:
            entry = entry.model_copy(update={'part_pose': list(part_pose)})
        try:
            named = entry.zones or file.zones
            of = zones or (path.parent / named if named else None)
            experiments += _read_experiments(path.parent, name, entry, of, remark)
        except PaintError as error:
            raise type(error)(f"{path}: experiment '{name}': {error}") from None
    start = None if file.model is None else str(path.parent / file.model)
    head = {key: text for key in HEAD if (text := getattr(file, key))}
    return Campaign(tuple(experiments), start, str(path), head, file.target_um, file.tolerance_um)


def _read_experiments(
    folder: Path, name: str, entry: _Entry, zones: str | Path | None, remark: Remark
) -> list[Experiment]:
    """One for each layer that was measured; ``zones`` is the file of theirs."""
    files = {kind: str(folder / getattr(entry, kind)) for kind in ('mesh', 'measurements')}
    coats, guns, solids = laid_coats(folder, entry, entry.coats)
    for number, file in enumerate(dict.fromkeys(file for file, *_ in guns), start=1):
        files['trajectory' if number == 1 else f'trajectory {number}'] = file
    down = None if entry.down is None else np.array(entry.down)
    # Readings are matched to the surface: a finer mesh only helps where that is strongly curved.
    surface = read_mesh(files['mesh'], entry.mesh_scale, 0.02, down, entry.body)
    trajectories = [read_motion(file, source) for file, source, _ in guns]
    paths = []
    for trajectory, (*_, brush) in zip(trajectories, guns, strict=True):
        path, counts, odd = checked_path(trajectory, entry.max_pose_gap_s)
        paths.append(with_brush(path, brush))
        for warning in odd:
            remark('warning', name, warning)
        if counts.rejected:
            remark('note', name, f'{counts.rejected} of {counts.received} poses dropped')
    surface = toward_the_guns(surface, ((p.position_m, p.rotation[:, :, 2]) for p in paths))
    for note in (*surface.notes, *(note for t in trajectories for note in t.notes)):
        remark('note', name, note)
    for warning in (warning for t in trajectories for warning in t.warnings):
        remark('warning', name, warning)
    points = None if entry.points is None else folder / entry.points
    layout = Layout(
        entry.columns, {kind: LENGTHS[unit_of(unit)] for kind, unit in entry.unit.items()},
        {None: '', 'comma': ',', 'point': '.'}[entry.decimal], entry.sheet or '', entry.zero or '',
    )  # fmt: skip
    readings = read_readings(files['measurements'], points, layout, surface)
    off = frozenset(entry.switched_off)
    settings: dict[str, float] = {}
    for trajectory in reversed(trajectories):
        settings |= trajectory.settings
    made = []
    for layer, rows in coats.by_layer(readings.layer).items():
        path, films = laid_path(coats, layer, paths)
        of_layer = readings.select(rows)
        if entry.wet:
            of_layer = dried(of_layer, solids_of(layer, coats, solids))
        if entry.under_um and layer == TOTAL:
            film_um = of_layer.thickness_um - entry.under_um
            understood = f'{of_layer.understood}; less {entry.under_um:g} µm below'
            of_layer = replace(of_layer, thickness_um=film_um, understood=understood)
        if coats.names != ('',):
            of_layer = replace(of_layer, layer=np.array(layer))
        band = (entry.target_um or 0.0, entry.tolerance_um or 0.0)
        experiment = Experiment.of(
            f'{name}: {layer}' if entry.coats and (layer != TOTAL or not rows.all()) else name,
            surface, path, of_layer, files=files, settings=settings, switched_off=off,
            frame_id=trajectories[0].frame_id, films=films, layer=layer,
            target=band if band[0] else None,
        )  # fmt: skip
        if zones and layer == TOTAL:  # what is wanted is the whole film
            of_part = read_zones(zones, files['mesh'], entry.mesh_scale, entry.body)
            its_files = experiment.files | {'zones': str(zones)}
            experiment = replace(experiment, zones=of_part.on(surface), files=its_files)
        made.append(experiment)
    return made
