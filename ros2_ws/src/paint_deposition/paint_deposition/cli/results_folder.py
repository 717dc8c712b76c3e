"""A folder of results that appears, or takes the place of an older one, as a whole."""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from paint_deposition.errors import PaintError

# In every folder of results: the names of what the last command wrote there, one a line.
MARKER = '.paint_results'


@contextmanager
def results_in(folder: Path) -> Iterator[Path]:
    """Give an empty folder to write to; when all is written, its content moves to ``folder``.

    What an earlier command wrote there is removed. Other files stay, unless a result has their
    name. Work that fails or is interrupted leaves the folder as it was.

    Raises:
        PaintError: a folder that no command made has the name of a result.
    """
    folder = folder.resolve()
    folder.parent.mkdir(parents=True, exist_ok=True)
    work = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f'.{folder.name}-'))
    try:
        yield work
        _move(work, folder)
    finally:
        shutil.rmtree(work)


def _move(work: Path, folder: Path) -> None:
    """Replace the former results. An interruption in between is made good by the next run."""
    folder.mkdir(exist_ok=True)
    marker = folder / MARKER
    former = marker.read_text(encoding='utf-8').splitlines() if marker.exists() else []
    fresh = sorted(path.name for path in work.iterdir())
    for name in fresh:
        if (folder / name).is_dir() and name not in former:
            raise PaintError(
                f'{folder / name} is a folder that was not written by paint; move it away, or '
                'choose another --output'
            )
    marker.write_text('\n'.join(sorted({*former, *fresh})) + '\n', encoding='utf-8')
    for name in former:
        # Only names beside the marker: it is a file that anyone can edit.
        old = folder / Path(name).name
        if old.is_dir():
            shutil.rmtree(old)
        else:
            old.unlink(missing_ok=True)
    for name in fresh:
        (work / name).replace(folder / name)
    marker.write_text('\n'.join(fresh) + '\n', encoding='utf-8')
