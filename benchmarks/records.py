"""Results that are kept line by line: a run that was cut off goes on where it was."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import click
from tqdm import tqdm

from paint_deposition.batch.cases import finished, workers

ROOT = Path(__file__).resolve().parents[1]


def results_option(name: str) -> Callable[[Callable], Callable]:
    """The option --results of a benchmark whose records are in runs/NAME."""
    kind = click.Path(path_type=Path)
    return click.option('--results', default=ROOT / 'runs' / name, type=kind, show_default=True)


def kept(results: Path) -> list[dict]:
    """The records in a file, none without it."""
    return (
        [json.loads(line) for line in results.read_text().splitlines()] if results.exists() else []
    )


def add(results: Path, run: Callable[[tuple], list[dict]], todo: Sequence[tuple]) -> list[dict]:
    """Run tasks as `paint sweep` runs its cases; return all records that the file holds."""
    results.parent.mkdir(parents=True, exist_ok=True)
    cases = [(repr(task), task, ()) for task in dict.fromkeys(todo)]
    with results.open('a') as file:
        done = finished(run, cases, {}, workers()) if todo else ()
        for _, future in tqdm(done, total=len(cases), mininterval=20):
            file.writelines(json.dumps(one, default=float) + '\n' for one in future.result())
            file.flush()
    return kept(results)
