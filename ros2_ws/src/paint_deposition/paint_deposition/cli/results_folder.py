"""What a command shows while it works, and the folder of its results, whole or as it was."""

import hashlib
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path, PurePosixPath
from threading import Event, Thread

from filelock import FileLock
from tqdm import tqdm

from paint_deposition.errors import PaintError
from paint_deposition.files.atomic import write_text

# A bar shows itself only for work that takes longer, and never when piped.
SHOW_PROGRESS_AFTER_S = 2.0
REDRAWN_EVERY_S = 0.5
BAR = '{desc}: {percentage:3.0f}%|{bar}| [{elapsed}]'
LINE = '{desc} [{elapsed}]'


class Progress:
    """A line that keeps counting the time, with a bar where the share of the work is known.

    Call it with what is being done and, where known, with the share of it that is done, 0 to 1.

    Args:
        command: its name, at the head of the line.
        after_s: work that takes no longer shows nothing [s].
    """

    def __init__(self, command: str, after_s: float = SHOW_PROGRESS_AFTER_S) -> None:
        self._command, self._after_s = command, after_s
        self._bar = tqdm(
            total=1.0, desc=command, bar_format=LINE, disable=None, leave=False, file=sys.stderr,
            delay=after_s,
        )  # fmt: skip
        self._done = Event()
        self._clock = Thread(target=self._redraw, daemon=True)

    def __enter__(self) -> 'Progress':
        if not self._bar.disable:
            self._clock.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._done.set()
        if self._clock.is_alive():
            self._clock.join()
        self._bar.close()

    def __call__(self, what: str, share: float | None = None) -> None:
        self._bar.bar_format = LINE if share is None else BAR
        self._bar.n = share or 0.0
        self._bar.set_description_str(f'{self._command}: {what}', refresh=False)

    def _redraw(self) -> None:
        """Show the newest line again and again, so that the clock runs within a step too."""
        pause_s = self._after_s
        while not self._done.wait(pause_s):
            self._bar.refresh()
            pause_s = REDRAWN_EVERY_S


# In every folder of results: the files that the last command wrote there, one a line.
MARKER = '.paint_results'


@contextmanager
def results_in(folder: Path) -> Iterator[Path]:
    """Give an empty folder to write to; when all is written, its content moves to ``folder``.

    What an earlier command wrote there is removed; other files stay. Work that fails or is
    interrupted leaves the folder as it was; what a killed command left is put right first. Another
    command waits until this one has written.

    Raises:
        PaintError: what no command wrote has the name of a result, or lies among former results.
    """
    folder = folder.resolve()
    # The temporary folder of this machine: a lock beside the results would stay there.
    key = hashlib.sha256(f'{Path.home()} {folder}'.encode()).hexdigest()[:16]
    with FileLock(Path(tempfile.gettempdir()) / f'paint-{key}.lock'):
        place = _Place(folder)
        place.put_right()
        made = [parent for parent in folder.parents if not parent.exists()]
        place.work.mkdir(parents=True)
        try:
            yield place.work
            place.replace()
        finally:
            place.put_right()
            with suppress(OSError):  # it is not empty any more
                for parent in made:
                    parent.rmdir()


class _Place:
    """A folder of results and, beside it, the work folder and the former results."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.work, self.former = (
            folder.with_name(f'.{folder.name}.paint_{what}') for what in ('work', 'former')
        )

    def replace(self) -> None:
        """Put the former results aside, by one rename where nothing else is there; the new in."""
        old, new = _written(self.folder), _files_below(self.work)
        present = {path.name for path in self.folder.iterdir()} if self.folder.exists() else set()
        ours = _tops(old | new)
        for name in sorted(ours & present):
            path = self.folder / name
            held = {f'{name}/{file}' for file in _files_below(path)} if _is_tree(path) else {name}
            for strange in sorted(held - old):
                raise PaintError(
                    f'{self.folder / strange} was not written by paint; move it away, or choose '
                    'another --output'
                )
        if not self.folder.exists() or (
            MARKER in present <= ours | {MARKER} and not Path.cwd().is_relative_to(self.folder)
        ):
            self._mark(self.work, new)
            with suppress(FileNotFoundError):
                shutil.copymode(self.folder, self.work)
                self.folder.rename(self.former)
            self.work.rename(self.folder)
            return
        self._mark(self.folder, old | new)
        self.former.mkdir()
        self._mark(self.former, old)
        for name in sorted(ours & present):
            (self.folder / name).rename(self.former / name)
        for path in sorted(self.work.iterdir()):
            path.rename(self.folder / path.name)
        self.former.rename(self.work / 'former')  # from here on the new results count
        self._mark(self.folder, new)

    def put_right(self) -> None:
        """Bring back former results unless the new ones count, and remove the rest."""
        if _is_tree(self.former) and not self.folder.exists():
            self.former.rename(self.folder)
        if _is_tree(self.work) and (self.former / MARKER).is_file():
            old = _tops(_written(self.former))
            for name in _tops(_written(self.folder)):
                is_new = name not in old or (self.former / name).exists()
                if is_new and (self.folder / name).exists():
                    (self.folder / name).rename(self.work / name)
            for path in sorted(self.former.iterdir(), reverse=True):  # its marker last
                path.replace(self.folder / path.name)
        for path in (self.former, self.work):
            if _is_tree(path):
                shutil.rmtree(path)

    def _mark(self, folder: Path, files: set[str]) -> None:
        """Name the files in the marker of a folder, by way of the work folder."""
        copy = self.work / f'{MARKER}_copy'
        write_text(copy, ''.join(f'{name}\n' for name in sorted(files)))
        copy.replace(folder / MARKER)


def _written(folder: Path) -> set[str]:
    """The files that the marker of a folder names, which anyone can edit: those in it only."""
    marker = folder / MARKER
    text = marker.read_text(encoding='utf-8', errors='replace') if marker.is_file() else ''
    paths = map(PurePosixPath, filter(str.isprintable, text.splitlines()))
    plain = (
        p for p in paths if p.parts and not p.is_absolute() and not {'..', MARKER} & {*p.parts}
    )
    return set(map(str, plain))


def _tops(files: set[str]) -> set[str]:
    """The names in the folder itself."""
    return {PurePosixPath(name).parts[0] for name in files}


def _files_below(folder: Path) -> set[str]:
    """All that is no folder, by its path from the folder."""
    return {
        path.relative_to(folder).as_posix() for path in folder.rglob('*') if not _is_tree(path)
    }


def _is_tree(path: Path) -> bool:
    """Whether it is a folder itself, and no link to one."""
    return path.is_dir() and not path.is_symlink()
