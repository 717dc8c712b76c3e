"""The runs of a line as work for many processes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from paint_deposition.batch.cluster.code import code_digest
from paint_deposition.batch.cluster.finished import digest_of
from paint_deposition.batch.cluster.run import Case
from paint_deposition.batch.line.line_file import LineFile, Run, read_line, runs_in
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ManyError, PaintError
from paint_deposition.files.model_file import read_model
from paint_deposition.files.provenance import model_digest, sha256
from paint_deposition.files.strict_yaml import read_yaml

# Keys of a campaign that name files.
FILES = {'mesh', 'trajectory', 'measurements', 'points', 'urdf'}


def line_cases(folder: Path) -> tuple[list[Case], LineFile, DepositionModel, list[str]]:
    """A case for each run of a folder; what it is computed from is in its digest.

    Returns:
        The cases, the line's file, its model, and names of files that belong to no run.

    Raises:
        PaintError: a file of the line that cannot be used.
    """
    folder = folder.resolve()
    file = read_line(folder)
    model = read_model(folder / file.model)
    files = shared_files(folder, file)
    told = {what: sha256(path) for what, path in files.items()}
    own = [effect.file_content.decode() for effect in model.effects]
    shared = [code_digest(), file.model_dump(), model_digest(model), own, *told.values()]
    given = {'file': file, 'folder': str(folder), 'model': model, 'mesh': told['mesh']}
    runs, strays = runs_in(folder, files.values())
    cases = [
        Case(
            digest_of(*shared, run.name, run.problem, run.remark, *_contents(run)),
            given | {'run': run},
            about={'part': [run.name]},
        )
        for run in runs
    ]
    return cases, file, model, strays


def shared_files(folder: Path, file: LineFile) -> dict[str, Path]:
    """Files that all runs share, by what they are; those that define the model left out."""
    named = {'mesh': file.mesh, 'points': file.points, 'urdf': file.urdf}
    return {what: folder / name for what, name in named.items() if name}


def _contents(run: Run) -> list[str]:
    """Digests of its files; in place of one that cannot be read stands why."""
    paths = [run.path, run.readings]
    if run.is_campaign:
        paths = [run.path.parent, *_named_by_campaign(run.path)]
    return [_digest(path) for path in paths if path]


def _digest(path: Path) -> str:
    try:
        return sha256(path)
    except PaintError as error:
        return str(error)


def _named_by_campaign(path: Path) -> list[Path]:
    """Files that a campaign names, wherever they lie; none if it cannot be read."""
    try:
        waiting: list[Any] = [read_yaml(path, 'campaign', ManyError)]
    except PaintError:
        return []
    found = []
    while waiting:
        value = waiting.pop()
        if isinstance(value, dict):
            named = {key: name for key, name in value.items() if key in FILES}
            found += [path.parent / name for name in named.values() if isinstance(name, str)]
            waiting += value.values()
        elif isinstance(value, list):
            waiting += value
    return sorted(found)
