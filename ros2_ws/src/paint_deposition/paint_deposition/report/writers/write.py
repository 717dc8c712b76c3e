"""One function that writes every result, and what the writers share."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import singledispatch
from importlib import import_module
from pathlib import Path
from typing import Any

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import PaintError
from paint_deposition.files.provenance import origin

Models = DepositionModel | Mapping[str, DepositionModel] | None
# Modules beside this one that register writers; those that import least come first.
WRITERS = ('film', 'plans', 'inference')


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


@contextmanager
def writable(folder: Path) -> Iterator[None]:
    """Give PaintError for what keeps files from being written to a folder."""
    try:
        yield
    except OSError as error:
        raise PaintError(
            f'{error.filename or folder}: {error.strerror}; choose a folder that can be written'
        ) from None


def input_files(made_from: Mapping[str, Any]) -> dict[str, str]:
    """Of what a command says of its inputs, those that are files."""
    keys = ('mesh_file', 'mesh', 'trajectory', 'model_file', 'model', 'zones_file')
    named = {key.removesuffix('_file'): str(made_from[key]) for key in keys if made_from.get(key)}
    return {what: file for what, file in named.items() if Path(file).exists()}


def with_provenance(
    made_from: Mapping[str, Any], model: Models, more_files: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """The entries with the provenance of their result: the model and the input files."""
    files = input_files(made_from) | dict(more_files or {})
    return {**made_from, 'provenance': origin(model, files)}
