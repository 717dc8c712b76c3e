"""A folder of runs over days: what all have in common, the runs in it, and each as a case."""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from pydantic import Field

from paint_deposition.batch.cases import Case, code_digest, digest_of
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.user_effects import load_unnamed_effect_file
from paint_deposition.errors import ManyError, PaintError
from paint_deposition.files.model_file import read_model
from paint_deposition.files.motion_source import MotionSource, Number, OnePart, Text
from paint_deposition.files.provenance import model_digest, sha256
from paint_deposition.files.refusals import checked
from paint_deposition.files.strict_yaml import read_yaml

NAME = 'line.yaml'
BAGS = ('.bag', '.mcap')
HELD = (*BAGS, '.db3')
DEEPER = 'a folder that holds recordings, which are left out; move them up beside line.yaml'
TABLES = ('.csv', '.tsv', '.txt', '.xlsx', '.xls', '.ods', '.parquet')


class LineFile(MotionSource, OnePart, extra='forbid'):
    """What all runs of a line share; paths are relative to the folder."""

    mesh: Text = Field(description='the name of a mesh file')
    model: Text = Field(description='the name of a model file, calibrated for this line')
    points: Text | None = Field(None, description='the name of a file of measuring points')
    max_edge_length_m: Number = Field(0.02, gt=0.0, description='longest edge of the mesh [m]')


@dataclass(frozen=True)
class Run:
    """One run of the line, named for its recording."""

    name: str
    path: Path  # its recording
    readings: Path | None = None  # on the part, or None
    problem: str = ''  # why it cannot be used
    remark: str = ''  # why its readings are not used; '' if they are


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


def runs_in(folder: Path, shared: Iterable[Path] = ()) -> tuple[list[Run], list[str]]:
    """The runs of a folder, by name, and names of files like readings that belong to none.

    A run is a recording (a folder of rosbag2, a .bag or a .mcap) with its readings, if any, beside
    it under the same name.

    Args:
        folder: of the line.
        shared: files in it that are no readings, such as measuring points.

    Raises:
        ManyError: there is no run.
    """
    recordings: dict[str, list[Path]] = defaultdict(list)
    readings: dict[str, list[Path]] = defaultdict(list)
    deeper: list[Run] = []
    for path in sorted(set(folder.iterdir()) - set(shared)):
        if path.name.startswith('.'):
            continue
        # One that was cut off has no metadata.
        held = [*path.glob('metadata.yaml'), *path.glob('*.mcap'), *path.glob('*.db3')]
        if path.is_dir() and held:
            recordings[path.name].append(path)
        elif path.is_dir() and any(p.suffix in HELD for p in path.rglob('*')):
            deeper.append(Run(f'{path.name}/', path, problem=DEEPER))
        elif path.suffix.lower() in BAGS:
            recordings[path.stem].append(path)
        elif path.suffix.lower() in TABLES:
            readings[path.stem].append(path)
    runs = [_run(name, paths, readings.pop(name, [])) for name, paths in recordings.items()]
    runs += deeper
    if not runs:
        raise ManyError(
            f'{folder}: holds no run; put recordings there (a rosbag2 folder, .bag or .mcap) and '
            'their readings beside them, under the same name'
        )
    return runs, [path.name for paths in readings.values() for path in paths]


def _run(name: str, recordings: list[Path], readings: list[Path]) -> Run:
    """The run of a name; an ambiguous one gets a problem or a remark."""
    problem = remark = ''
    if len(recordings) > 1:
        names = ' and '.join(path.name for path in recordings)
        problem = f'two recordings have its name, {names}; rename one'
    if len(readings) > 1:
        names = ' and '.join(path.name for path in readings)
        remark = f'two files of readings have its name, {names}; keep one'
    only = readings[0] if len(readings) == 1 else None
    return Run(name, recordings[0], only, problem, remark)


def line_cases(folder: Path) -> tuple[list[Case], LineFile, DepositionModel, list[str]]:
    """A case for each run of a folder; what it is computed from is in its digest.

    Returns:
        The cases, the line's file, its model, and names of files that belong to no run.

    Raises:
        PaintError: a file of the line that cannot be used.
    """
    folder = folder.resolve()
    file = read_line(folder)
    model = read_model(folder / file.model, load_unnamed_effect_file)
    files = shared_files(folder, file)
    own = [effect.file_content.decode() for effect in model.effects]
    shared = [code_digest(), file.model_dump(), model_digest(model), own]
    shared += map(sha256, files.values())
    parameters = {'file': file, 'folder': str(folder), 'model': model}
    runs, unmatched = runs_in(folder, files.values())
    cases = []
    for run in runs:
        own_files = [_digest(path) for path in (run.path, run.readings) if path]
        digest = digest_of(*shared, run.name, run.problem, run.remark, *own_files)
        cases.append(Case(digest, parameters | {'run': run}, known={'part': [run.name]}))
    return cases, file, model, unmatched


def shared_files(folder: Path, file: LineFile) -> dict[str, Path]:
    """Files that all runs share, by what they are; those that define the model left out."""
    named = {'mesh': file.mesh, 'points': file.points, 'urdf': file.urdf}
    return {what: folder / name for what, name in named.items() if name}


def _digest(path: Path) -> str:
    """Of a file; in place of one that cannot be read stands why."""
    try:
        return sha256(path)
    except PaintError as error:
        return str(error)
