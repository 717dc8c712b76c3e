"""A folder of runs over days: what all have in common, and the runs in it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import Field

from paint_deposition.errors import ManyError
from paint_deposition.files.motion_source import MotionSource, Number, Text
from paint_deposition.files.refusals import checked
from paint_deposition.files.strict_yaml import read_yaml
from paint_deposition.motion.path_builder import DEFAULT_MAX_POSE_GAP_S

NAME, CAMPAIGN = 'line.yaml', 'campaign.yaml'
BAGS = ('.bag', '.mcap')
TABLES = ('.csv', '.tsv', '.txt', '.xlsx', '.xls', '.ods')


class LineFile(MotionSource, extra='forbid'):
    """What all runs of a line share; paths are relative to the folder."""

    mesh: Text = Field(description='the name of a mesh file')
    model: Text = Field(description='the name of a model file, calibrated for this line')
    points: Text | None = Field(None, description='the name of a file of measuring points')
    mesh_scale: Number = Field(1.0, gt=0.0, description='metres per unit of the mesh')
    body: Text | None = Field(None, description='the name of the one body to take of the mesh')
    down: Annotated[list[Number], Field(min_length=3, max_length=3)] | None = Field(
        None, description='[x, y, z], the direction of gravity in the mesh frame'
    )
    max_edge_length_m: Number = Field(0.02, gt=0.0, description='longest edge of the mesh [m]')
    max_pose_gap_s: Number = Field(
        DEFAULT_MAX_POSE_GAP_S, gt=0.0, description='longest gap between poses in a stroke [s]'
    )


@dataclass(frozen=True)
class Run:
    """One run of the line.

    Attributes:
        name: of its folder or file.
        path: a recording, or a campaign file.
        readings: a file of gauge readings on the part, or None.
    """

    name: str
    path: Path
    readings: Path | None = None

    @property
    def is_campaign(self) -> bool:
        """Whether it is a campaign's file."""
        return self.path.name == CAMPAIGN


def read_line(folder: Path) -> LineFile:
    """Read what the runs of a folder share.

    Raises:
        ManyError: naming the file, the key at fault and the remedy.
    """
    path = folder / NAME
    if not path.is_file():
        raise ManyError(
            f'{folder}: has no {NAME}; write one that names the mesh and the model of the line'
        )
    content = read_yaml(path, 'line', ManyError)
    if not isinstance(content, dict):
        raise ManyError(f'{path}: is not a line; expected the keys mesh and model')
    file = checked(LineFile, f'{path}: line', content, ManyError)
    return file.model_copy(update={'urdf': file.urdf and str(folder / file.urdf)})


def runs_in(folder: Path) -> list[Run]:
    """The runs of a folder, by name.

    A run is a recording (a folder of rosbag2, a .bag or a .mcap) with its readings, if any, beside
    it under the same name; or a folder with a campaign.yaml.

    Raises:
        ManyError: there is none, or readings that belong to no run.
    """
    runs = []
    for path in sorted(folder.iterdir()):
        if path.is_dir() and (path / CAMPAIGN).is_file():
            runs.append(Run(path.name, path / CAMPAIGN))
        elif (path / 'metadata.yaml').is_file():
            runs.append(Run(path.name, path, _beside(folder, path.name)))
        elif path.suffix in BAGS:
            runs.append(Run(path.stem, path, _beside(folder, path.stem)))
    if not runs:
        raise ManyError(
            f'{folder}: holds no run; put recordings there (a rosbag2 folder, .bag or .mcap) and '
            'their readings beside them, under the same name'
        )
    return runs


def _beside(folder: Path, name: str) -> Path | None:
    places = (folder / f'{name}{suffix}' for suffix in TABLES)
    return next((place for place in places if place.is_file()), None)
