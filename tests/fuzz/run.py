"""Fuzzes the readers one after the other: `make fuzz`, `make fuzz ARGS='--seconds 600 rapid ply'`.

Corpus and findings stay in `runs/fuzz`, so that every run begins where the last one ended. Ends
with 1 where something was found. Atheris, the fuzzer, is there for Linux on x86-64 only.
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
import os
import re
import sys
import time
from pathlib import Path
from typing import NoReturn

import click

READ = re.compile(r'number_of_executed_units: (\d+)|^#(\d+)', re.MULTILINE)
OF_CORPUS = re.compile(r'^#(\d+)\s+INITED', re.MULTILINE)


@click.command()
@click.argument('names', nargs=-1)
@click.option('--seconds', default=60.0, show_default=True, help='Time for each reader.')
@click.option('--inputs', default=-1, show_default=True, help='Most inputs for each; -1: any.')
@click.option('--seed', default=0, help='For the same inputs again; 0: always new ones.')
@click.option('--place', default='runs/fuzz', show_default=True, type=click.Path(path_type=Path))
def main(names: tuple[str, ...], seconds: float, inputs: int, seed: int, place: Path) -> None:
    """Fuzz the readers of these NAMES; default: all."""
    if importlib.util.find_spec('atheris') is None:
        raise click.ClickException('needs atheris, which has wheels for Linux on x86-64 only')
    for threads in ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'NUMBA_NUM_THREADS'):
        os.environ[threads] = '1'
    os.environ['PAINT_CACHE_DIR'] = ''
    with contextlib.redirect_stderr(io.StringIO()):  # a line for every module
        from fuzz.reading import targets

    readers = targets()
    if unknown := set(names) - {*readers}:
        known = ' '.join(readers)
        raise click.ClickException(f'no reader {" ".join(unknown)}; there are: {known}')
    place.mkdir(parents=True, exist_ok=True)
    found = 0
    for name in names or readers:
        count = _fuzz_in_processes(name, place, seconds, inputs, seed)
        findings = sorted((place / 'findings' / name).glob('*[!t]'))
        lines = [f'{name}: {count} inputs, {len(findings)} findings', *map(str, findings)]
        print('\n  '.join(lines), flush=True)
        found += len(findings)
    sys.exit(1 if found else 0)


def _fuzz_in_processes(name: str, place: Path, seconds: float, inputs: int, seed: int) -> int:
    """The number of new inputs; a process that hangs or crashes is followed by another."""
    deadline, read, known = time.monotonic() + seconds, 0, 0
    while (left_s := round(deadline - time.monotonic())) > 0 and (inputs < 0 or read < inputs):
        log = place / f'{name}.log'
        limits = [f'-max_total_time={left_s}', f'-runs={inputs - read if inputs > 0 else -1}']
        process = os.fork()
        if not process:
            _fuzz_here(name, place, log, [*limits, f'-seed={seed}'])
        _, status = os.waitpid(process, 0)
        text = log.read_text(errors='replace')
        numbers = [int(unit or mark) for unit, mark in READ.findall(text)]
        if not numbers:
            raise click.ClickException(f'{name} does not start; see {log}')
        of_corpus = OF_CORPUS.search(text)
        read += max(numbers)
        known += int(of_corpus[1]) if of_corpus else max(numbers)
        if not status:
            break
    return read - known


def _fuzz_here(name: str, place: Path, log: Path, arguments: list[str]) -> NoReturn:
    """In a process of its own."""
    with log.open('wb') as stream:
        os.dup2(stream.fileno(), 1)
        os.dup2(stream.fileno(), 2)
    from fuzz.reading import fuzz, targets

    fuzz(name, targets()[name], place, arguments)


if __name__ == '__main__':
    main()
