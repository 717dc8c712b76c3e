"""Zones files: regions of a part, each with the film wanted there."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, BeforeValidator, Field, model_validator

from paint_deposition.errors import PaintError, quoted
from paint_deposition.files.atomic import read_yaml
from paint_deposition.files.meshes import read_triangles
from paint_deposition.film.statistics import require_band
from paint_deposition.part.zones import Zone, Zones
from paint_deposition.request import Name, Number, Text, validate

FACES = 'a list of numbers of triangles from 0, as 7, or of ranges, as 0-119'


def _number_range(written: Any) -> tuple[int, int]:
    """First and last of '0-119', or of 7."""
    ends = str(written).split('-')
    if isinstance(written, bool) or len(ends) > 2 or not all(e.strip().isdecimal() for e in ends):
        raise ValueError(f'{quoted(written)} is no number and no range of numbers; give {FACES}')
    first, last = int(ends[0]), int(ends[-1])
    if last < first:
        raise ValueError(f'{quoted(written)} ends before it begins; swap the two')
    return first, last


class ZoneEntry(BaseModel, extra='forbid'):
    """A zone as it is written; paths are relative to its file."""

    name: Annotated[Name, Field(min_length=1, description='what to call it')]
    target_um: Number = Field(gt=0.0, description='the film wanted, above 0 [um]')
    tolerance_um: Number = Field(gt=0.0, description='what the film may differ, above 0 [um]')
    box: (
        Annotated[
            list[Annotated[list[Number], Field(min_length=3, max_length=3)]],
            Field(min_length=2, max_length=2),
        ]
        | None
    ) = Field(
        None, description='two corners, [[x, y, z], [x, y, z]], in the frame of the mesh [m]'
    )
    mesh: Text | None = Field(None, description='the name of a mesh file')
    mesh_scale: Number | None = Field(
        None, gt=0.0, description='metres per unit of mesh, above 0; default: as of the part'
    )
    body: Text | None = Field(None, description='the name of a body in the mesh file')
    faces: list[Annotated[tuple[int, int], BeforeValidator(_number_range)]] | None = Field(
        None, min_length=1, description=FACES
    )

    @model_validator(mode='after')
    def _complete(self) -> 'ZoneEntry':
        try:
            require_band(self.target_um, self.tolerance_um)
        except PaintError as error:
            raise ValueError(str(error)) from None
        if self.mesh_scale and not self.mesh:
            raise ValueError('mesh_scale has no mesh; give both, or --mesh-scale for the part')
        if not (self.box or self.mesh or self.body or self.faces):
            raise ValueError('it has no place; give box, body, faces or mesh')
        if self.box and not all(low < high for low, high in zip(*self.box, strict=True)):
            raise ValueError(f'box is {self.box}; give its lowest corner first, then its highest')
        return self


def read_zones(
    path: str | Path, mesh: str | Path, scale: float = 1.0, body: str | None = None
) -> Zones:
    """Read the zones of a part.

    Args:
        path: YAML with a list ``zones``; paths in it are relative to it.
        mesh, scale, body: the part, as ``read_mesh`` takes it.

    Raises:
        PaintError: naming the file, the zone and the key at fault, and the remedy.
    """
    path = Path(path)
    content = read_yaml(path, 'zones', PaintError)
    if not isinstance(content, dict) or [*content] != ['zones'] or not content['zones']:
        raise PaintError(f"{path}: has no list 'zones'; begin with zones: and give one at least")
    if not isinstance(content['zones'], list):
        raise PaintError(f"{path}: 'zones' is no list; begin each zone with a dash")
    zones: list[Zone] = []
    for number, written in enumerate(content['zones'], start=1):
        entry = validate(ZoneEntry, f'{path}: zone {number}', written, PaintError)
        if entry.name in [zone.name for zone in zones]:
            raise PaintError(f"{path}: two zones are called '{entry.name}'; rename one")
        try:
            triangles_m = _triangles_m(path.parent, entry, Path(mesh), scale, body)
        except PaintError as error:
            raise type(error)(f"{path}: zone '{entry.name}': {error}") from None
        box_m = np.array(entry.box) if entry.box else None
        zones.append(Zone(entry.name, entry.target_um, entry.tolerance_um, box_m, triangles_m))
    return Zones(tuple(zones))


def _triangles_m(
    folder: Path, entry: ZoneEntry, part: Path, scale: float, body: str | None
) -> np.ndarray | None:
    if not (entry.mesh or entry.body or entry.faces):
        return None
    mesh = folder / entry.mesh if entry.mesh else part
    of_mesh = entry.body or (None if entry.mesh else body)
    vertices_m, faces, rows, _ = read_triangles(mesh, entry.mesh_scale or scale, of_mesh)
    if entry.faces and rows is None:
        raise PaintError(
            f'faces: {mesh} has several bodies, in no order of their own; name one with body, '
            f'which numbers its triangles from 0 (paint inspect {mesh} lists them)'
        )
    if entry.faces and rows is not None:
        highest, most = int(rows[-1]), max(last for _, last in entry.faces)
        if most > highest:
            raise PaintError(f'faces: {mesh} has no triangle {most}, its last is {highest}')
        within = [(rows >= a) & (rows <= b) for a, b in entry.faces]
        faces = faces[np.logical_or.reduce(within)]
    return vertices_m[faces]
