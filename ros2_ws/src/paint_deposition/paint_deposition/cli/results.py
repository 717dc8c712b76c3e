"""What a command shows while it works, and the folder of its results, whole or as it was."""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from threading import Event, Thread
from typing import TYPE_CHECKING, Any

import click
from tqdm import tqdm

import paint_deposition as pd
from paint_deposition.cli.options import FOLDER, JSON, Decorator, option_group
from paint_deposition.errors import PaintError
from paint_deposition.files.atomic import WORK, write_text

if TYPE_CHECKING:
    from paint_deposition.film.statistics import FilmStatistics

# A bar shows itself only for work that takes longer, and never when piped.
SHOW_PROGRESS_AFTER_S = 2.0
BAR = '{desc}: {percentage:3.0f}%|{bar}| [{elapsed}]'
LINE = '{desc} [{elapsed}]'
Show = Callable[..., None]


@contextmanager
def progress(command: str, after_s: float = SHOW_PROGRESS_AFTER_S) -> Iterator[Show]:
    """Keep a line that counts the time, with a bar where the share of the work is known.

    Call what it gives with what is being done and, where known, with the share of it that is done,
    0 to 1.

    Args:
        command: its name, at the head of the line.
        after_s: work that takes no longer shows nothing [s].
    """
    bar = tqdm(
        total=1.0, desc=command, bar_format=LINE, disable=None, leave=False, file=sys.stderr,
        delay=after_s,
    )  # fmt: skip
    done = Event()

    def show(what: str, share: float | None = None) -> None:
        bar.bar_format = LINE if share is None else BAR
        bar.n = share or 0.0
        bar.set_description_str(f'{command}: {what}', refresh=False)

    def redraw() -> None:
        """Show the newest line again and again, so that the clock runs within a step too."""
        pause_s = after_s
        while not done.wait(pause_s):
            bar.refresh()
            pause_s = 0.5

    clock = Thread(target=redraw, daemon=True)
    if not bar.disable:
        clock.start()
    try:
        yield show
    finally:
        done.set()
        if clock.is_alive():
            clock.join()
        bar.close()


def print_all(label: str, lines: Iterable[str]) -> None:
    """Print each line behind its label on stderr: notes, warnings."""
    for line in lines:
        click.echo(f'{label}: {line}', err=True)


def python(code: str, *words: str) -> list[str]:
    """The command of another Python that runs code and takes no module from this folder."""
    head = 'import sys; sys.path[:] = filter(None, sys.path); '
    return [sys.executable, '-c', head + code, *words]


def inputs(**files: Path | None) -> dict[str, str]:
    """The files that a result was made from, by what they are."""
    return {what: str(file or '') for what, file in files.items()}


@dataclass
class Results:
    """Where a command writes its results, and how it shows them."""

    output: Path
    pictures: str
    as_json: bool
    files: Sequence[Path] = ()

    def write(self, result: Any, **more: Any) -> None:
        """Write a result to the folder, all or nothing."""
        with results_in(self.output) as folder:
            files = pd.write(result, folder, pictures=self.pictures, **more)
        self.files = [self.output / file.name for file in files]

    def print(
        self,
        lines: Iterable[str],
        model: str = '',
        notes: Iterable[str] = (),
        warnings: Iterable[str] = (),
    ) -> None:
        """Print the file of figures as written, or else the model, these lines and the files."""
        print_all('note', notes)
        print_all('warning', warnings)
        head = [f'model: {model}'] if model else []
        if self.as_json:
            figures = next(file for file in self.files if file.suffix == '.json')
            click.echo(figures.read_text(encoding='utf-8'), nl=False)
        else:
            click.echo('\n'.join([*head, *lines, *(f'  {file}' for file in self.files)]))


def results_options(what: str, default: str | None = None) -> Decorator:
    """A command takes ``Results``; their folder is to be named where there is no default."""
    text = (
        f'Folder for {what}. It is made if it is not there. Results that an earlier command wrote '
        'into it are removed; other files in it are kept as they are. Nothing is changed before '
        'all results are complete.'
    )
    each = {
        'output': click.option('-o', '--output', type=FOLDER, help=text,
                               **({'default': default} if default else {'required': True})),
        'pictures': click.option('--pictures', type=click.Choice(['png', 'svg', 'pdf']),
                                 default='png', show_default=True, help='Format of the pictures.'),
        'as_json': JSON,
    }  # fmt: skip
    return option_group(each, 'results', Results)


def zone_lines(
    now: Mapping[str, FilmStatistics], before: Mapping[str, FilmStatistics] | None = None
) -> Iterator[str]:
    """The film on each zone by its name, and what it was before."""
    for name, zone in now.items():
        was = before and before[name]
        bare = f', {100 * (1.0 - zone.coverage):.1f} % of it bare' if zone.coverage < 1.0 else ''
        yield (
            f'{name}, {zone.target_um:g} ± {zone.target_tolerance_um:g} µm: '
            f'{f"{was.mean_um:.1f} → " if was else ""}{zone.mean_um:.1f} µm mean, '
            f'{zone.min_um:.1f} to {zone.max_um:.1f} µm, '
            f'{f"{100 * was.within_target:.1f} → " if was else ""}'
            f'{100 * zone.within_target:.1f} % within{bare}'
        )


# In every folder of results: the files that the last command wrote there, each with its digest.
MARKER = '.paint_results'


@contextmanager
def results_in(folder: Path) -> Iterator[Path]:
    """Give an empty folder to write to; when all is written, its content moves to ``folder``.

    What an earlier command wrote there is removed; other files stay. Work that fails or is
    interrupted leaves the folder as it was; what a killed command left is put right first. Another
    command waits until this one has written, whoever gives it and from whichever container.

    Raises:
        PaintError: what no command wrote has the name of a result, or lies among former results.
    """
    folder = folder.resolve()
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    with ExitStack() as stack:
        while True:
            folder.mkdir(parents=True, exist_ok=True)
            try:
                import fcntl

                lock = os.open(folder, os.O_RDONLY)
                stack.callback(os.close, lock)
                fcntl.flock(lock, fcntl.LOCK_EX)
            except (ImportError, OSError):  # a system or a disk without such locks
                from filelock import FileLock

                key = hashlib.sha256(str(folder).encode()).hexdigest()[:16]
                file = Path(tempfile.gettempdir()) / f'paint-{key}.lock'
                stack.enter_context(FileLock(file, mode=0o600))
                break
            if folder.exists() and os.path.samestat(os.fstat(lock), folder.stat()):
                break  # and not the one that a command has removed meanwhile
        work = folder / WORK
        try:
            _put_right(folder, work)
            work.mkdir()
            (work / MARKER).touch()
            (work / 'new').mkdir()
            yield work / 'new'
            _replace(folder, work)
        finally:
            _put_right(folder, work)
            with suppress(OSError):  # it is not empty any more
                for path in made:
                    path.rmdir()


def _replace(folder: Path, work: Path) -> None:
    """Put the former results aside and the new in, each file by a rename."""
    from paint_deposition.files.provenance import sha256

    former, new = work / 'former', work / 'new'
    fresh = {name: sha256(new / name) for name in _files_below(new)}
    places = ((folder / name, name, digest) for name, digest in _written(folder).items())
    files = (one for one in places if one[0].is_file() and not one[0].is_symlink())
    old = {name: digest for path, name, digest in files if sha256(path) == digest}
    ours = _tops({*old, *fresh}) & {path.name for path in folder.iterdir()}
    for name in sorted(ours):
        path = folder / name
        held = {f'{name}/{file}' for file in _files_below(path)} if _is_tree(path) else {name}
        for strange in sorted(held - {*old}):
            raise PaintError(
                f'{folder / strange} was not written by paint, or was changed since; move it '
                'away, or choose another --output'
            )
    former.mkdir()
    _mark(work, former, old)
    _mark(work, folder, old | fresh)
    for name in sorted(ours):
        (folder / name).rename(former / name)
    for path in sorted(new.iterdir()):
        path.rename(folder / path.name)
    former.rename(work / 'replaced')  # from here on the new results count
    _mark(work, folder, fresh)


def _put_right(folder: Path, work: Path) -> None:
    """Bring back former results unless the new ones count, and remove the rest."""
    if not os.path.lexists(work):
        return
    if not _is_tree(work) or (any(work.iterdir()) and not (work / MARKER).is_file()):
        raise PaintError(f'{work} was not written by paint; move it away')
    former = work / 'former'
    if (former / MARKER).is_file():
        old = _tops({*_written(former)})
        for name in _tops({*_written(folder)}):
            is_new = name not in old or (former / name).exists()
            if is_new and (folder / name).exists():
                (folder / name).rename(work / 'new' / name)
        for path in sorted(former.iterdir(), key=lambda path: path.name == MARKER):  # it last
            path.replace(folder / path.name)
        if not _written(folder):
            (folder / MARKER).unlink()
    for path in sorted(work.iterdir(), key=lambda path: path.name == MARKER):
        shutil.rmtree(path) if _is_tree(path) else path.unlink()
    work.rmdir()


def _mark(work: Path, folder: Path, files: Mapping[str, str]) -> None:
    """Name the files in the marker of a folder, by way of the work folder."""
    copy = work / f'{MARKER}_copy'
    write_text(copy, ''.join(f'{files[name]}  {name}\n' for name in sorted(files)))
    copy.replace(folder / MARKER)


def _written(folder: Path) -> dict[str, str]:
    """The files that the marker of a folder names, those in it only, and their digests.

    Anyone can edit it: who wants a file removed has to know what is in it.
    """
    marker = folder / MARKER
    text = marker.read_text(encoding='utf-8', errors='replace') if marker.is_file() else ''
    found = {}
    for digest, _, name in (line.partition('  ') for line in text.splitlines()):
        path = PurePosixPath(name)
        strange = path.is_absolute() or {'..', MARKER, WORK} & {*path.parts}
        if path.parts and not strange and name.isprintable():
            found[str(path)] = digest
    return found


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
