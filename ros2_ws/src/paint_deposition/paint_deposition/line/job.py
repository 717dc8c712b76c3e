"""The runs of a line as work for many processes."""

from __future__ import annotations

from pathlib import Path

from paint_deposition.cluster.code import code_digest
from paint_deposition.cluster.finished import digest_of
from paint_deposition.cluster.run import Case
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ManyError
from paint_deposition.files.model_file import read_model
from paint_deposition.files.provenance import model_digest, sha256
from paint_deposition.line.line_file import LineFile, Run, read_line, runs_in


def line_cases(
    folder: Path,
) -> tuple[list[Case], LineFile, DepositionModel]:
    """A case for each run of a folder; what it is computed from is in its digest.

    Raises:
        PaintError: a file of the line that cannot be used.
    """
    folder = folder.resolve()
    file = read_line(folder)
    model = read_model(folder / file.model)
    own = [effect.id for effect in model.effects if effect.file is not None]
    if own:
        raise ManyError(
            f'{folder / file.model}: {own[0]} is an effect file of your own, which workers do '
            'not have; take a model without it'
        )
    told = [sha256(path) for path in shared_files(folder, file).values()]
    shared = [code_digest(), file.model_dump(), model_digest(model), *told]
    given = {'file': file, 'folder': str(folder), 'model': model}
    cases = [
        Case(
            digest_of(*shared, run.name, *_contents(run)),
            given | {'run': run},
            about={'part': [run.name]},
        )
        for run in runs_in(folder)
    ]
    return cases, file, model


def shared_files(folder: Path, file: LineFile) -> dict[str, Path]:
    """Files that all runs share, by what they are; those that define the model left out."""
    named = {'mesh': file.mesh, 'points': file.points, 'urdf': file.urdf}
    return {what: folder / name for what, name in named.items() if name}


def _contents(run: Run) -> list[str]:
    if run.is_campaign:
        return [sha256(run.path.parent)]
    return [sha256(path) for path in (run.path, run.readings) if path]
