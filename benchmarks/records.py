"""Results that are kept line by line: a run that was cut off goes on where it was."""

import importlib
import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from distributed import as_completed
from tqdm import tqdm

from paint_deposition.batch.cluster import workers


def kept(results: Path) -> list[dict]:
    """The records in a file, none without it."""
    return (
        [json.loads(line) for line in results.read_text().splitlines()] if results.exists() else []
    )


def add(
    results: Path,
    run: Callable[[tuple], list[dict]],
    todo: Sequence[tuple],
    processes: int,
    scheduler: str | None = None,
) -> list[dict]:
    """Run tasks side by side, append their records to a file, and return all that it holds.

    Args:
        processes: workers on this machine.
        scheduler: address of one whose workers are taken instead; see ``cluster.workers``.
    """
    results.parent.mkdir(parents=True, exist_ok=True)
    with workers(scheduler, processes) as client, results.open('a') as file:
        left = client.map(_importable(run), todo, pure=False)
        for future in tqdm(as_completed(left), total=len(todo), mininterval=20):
            records = future.result()
            file.writelines(json.dumps(record, default=float) + '\n' for record in records)
            file.flush()
            future.release()
    return kept(results)


def _importable(run: Callable) -> Callable:
    """The same function where workers find it: in its module, not in the script that runs."""
    if run.__module__ != '__main__':
        return run
    script = Path(sys.modules['__main__'].__file__)
    return getattr(importlib.import_module(f'benchmarks.{script.stem}'), run.__name__)
