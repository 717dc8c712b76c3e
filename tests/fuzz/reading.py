"""Feeds changed files to one reader, guided by the code that they reach.

A finding is any exception but a PaintError of one line, a hang, or a crash of the process.
Findings are kept as files with their tracebacks.
"""

from __future__ import annotations

import json
import resource
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

import atheris

import paint_deposition

PACKAGE = Path(paint_deposition.__file__).parent
# The rooms below the readers: much of them is compiled, which is not possible with the marks.
UNMARKED = [
    '.'.join(path.relative_to(PACKAGE.parent).with_suffix('').parts).removesuffix('.__init__')
    for path in PACKAGE.rglob('*.py')
    if path.relative_to(PACKAGE).parts[0] != 'files'
]

with atheris.instrument_imports(
    include=['paint_deposition', 'rosbags', 'mcap', 'trimesh'], exclude=UNMARKED
):
    from fuzz.targets import Target, targets

from paint_deposition.errors import PaintError  # noqa: E402

__all__ = ['fuzz', 'targets']
# What a reader may take beyond what the process has before it begins.
MEMORY_BYTES = 1_000_000_000
HANG_S = 10


def fuzz(name: str, target: Target, place: Path, arguments: Sequence[str]) -> NoReturn:
    """Fuzz one reader until a limit among libFuzzer's arguments, and end the process.

    Args:
        name: of the reader.
        target: what to read.
        place: folder of corpus, findings and log.
        arguments: of libFuzzer.
    """
    corpus, findings = place / 'corpus' / name, place / 'findings' / name
    for folder in (corpus, findings):
        folder.mkdir(parents=True, exist_ok=True)
    reader = Reader(target, place / f'{name}{target.suffix}', findings)
    for number, seed in enumerate(target.seeds()):
        (corpus / f'seed_{number}').write_bytes(seed)
        # What is loaded and compiled once is no part of the limits.
        reader(seed)
    words = place / f'{name}.words'
    words.write_text(''.join(f'{_escaped(word)}\n' for word in target.words))
    limits = [f'-timeout={HANG_S}', '-rss_limit_mb=0', '-print_final_stats=1']
    where = [str(corpus), f'-artifact_prefix={findings}/']
    if target.words:
        where.append(f'-dict={words}')
    atheris.Setup([sys.argv[0], *where, *limits, *arguments], reader)
    taken = int(Path('/proc/self/statm').read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (taken + MEMORY_BYTES,) * 2)
    atheris.Fuzz()
    sys.exit()


class Reader:
    """Reads one input after the other and keeps what it finds, each kind once."""

    def __init__(self, target: Target, path: Path, findings: Path) -> None:
        self._target = target
        self._path = path
        self._findings = findings

    def __call__(self, data: bytes) -> None:
        self._path.write_bytes(self._target.around(data))
        try:
            self._target.read(self._path)
        except PaintError as error:
            if '\n' in str(error) or not str(error).strip():
                self._keep('not_one_line', error)
        except (Exception, SystemExit) as error:
            self._keep(type(error).__name__, error)

    def _keep(self, kind: str, error: BaseException) -> None:
        ours = [
            frame for frame in traceback.extract_tb(error.__traceback__)
            if '/paint_deposition/' in frame.filename
        ]  # fmt: skip
        where = f'{Path(ours[-1].filename).stem}_{ours[-1].lineno}' if ours else 'elsewhere'
        found = self._findings / f'{kind}-{where}{self._target.suffix}'
        if not found.exists():
            found.write_bytes(self._path.read_bytes())
            found.with_suffix('.txt').write_text(''.join(traceback.format_exception(error)))


def _escaped(word: str) -> str:
    """As libFuzzer's dictionaries have it."""
    return json.dumps(word).replace('\\t', '\\x09').replace('\\u00', '\\x')
