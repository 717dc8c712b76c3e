"""Zones files: regions of a part, each with the film wanted there."""

from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, Field, model_validator

from paint_deposition.errors import PaintError
from paint_deposition.files.atomic import read_yaml
from paint_deposition.files.meshes import read_triangles
from paint_deposition.film.statistics import require_band
from paint_deposition.part.zones import Zone, Zones
from paint_deposition.request import Name, Number, Text, validate


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

    @model_validator(mode='after')
    def _complete(self) -> 'ZoneEntry':
        try:
            require_band(self.target_um, self.tolerance_um)
        except PaintError as error:
            raise ValueError(str(error)) from None
        if self.mesh_scale and not self.mesh:
            raise ValueError('mesh_scale has no mesh; give both, or --mesh-scale for the part')
        if not (self.box or self.mesh or self.body):
            raise ValueError('it has no place; give box, body or mesh')
        if self.box and not all(low < high for low, high in zip(*self.box, strict=True)):
            raise ValueError(f'box is {self.box}; give its lowest corner first, then its highest')
        return self


def read_zones(path: str | Path, mesh: str | Path, scale: float = 1.0) -> Zones:
    """Read the zones of a part.

    Args:
        path: YAML with a list ``zones``; paths in it are relative to it.
        mesh, scale: the part, as ``read_mesh`` takes it.

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
        triangles_m = None
        if entry.mesh or entry.body:
            file = path.parent / entry.mesh if entry.mesh else mesh
            try:
                vertices_m, faces, _ = read_triangles(file, entry.mesh_scale or scale, entry.body)
            except PaintError as error:
                raise type(error)(f"{path}: zone '{entry.name}': {error}") from None
            triangles_m = vertices_m[faces]
        box_m = np.array(entry.box) if entry.box else None
        zones.append(Zone(entry.name, entry.target_um, entry.tolerance_um, box_m, triangles_m))
    return Zones(tuple(zones))
