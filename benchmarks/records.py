"""Results that are kept line by line: a run that was cut off goes on where it was."""

import json
import multiprocessing
from collections.abc import Callable, Sequence
from pathlib import Path

from tqdm import tqdm


def kept(results: Path) -> list[dict]:
    """The records in a file, none without it."""
    return (
        [json.loads(line) for line in results.read_text().splitlines()] if results.exists() else []
    )


def add(
    results: Path, run: Callable[[tuple], list[dict]], todo: Sequence[tuple], processes: int
) -> list[dict]:
    """Run tasks side by side, append their records to a file, and return all that it holds."""
    results.parent.mkdir(parents=True, exist_ok=True)
    with multiprocessing.get_context('spawn').Pool(processes) as pool, results.open('a') as file:
        for found in tqdm(pool.imap_unordered(run, todo), total=len(todo), mininterval=20):
            file.writelines(json.dumps(record, default=float) + '\n' for record in found)
            file.flush()
    return kept(results)
