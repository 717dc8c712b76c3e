"""Cases computed by workers, each kept as soon as it is there."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from paint_deposition.cluster.finished import Columns, Finished
from paint_deposition.cluster.packing import packed
from paint_deposition.cluster.workers import workers, workers_in_words
from paint_deposition.errors import ManyError

if TYPE_CHECKING:
    from distributed import Client, Future

Progress = Callable[[str, float], None]
# Inputs that a worker keeps open.
OPENED = 8


@dataclass(frozen=True)
class Case:
    """One piece of work.

    Attributes:
        digest: of all that it is computed from; the same digest is never computed twice.
        given: what is its own, small.
        inputs: names of what it shares with others, such as a part or a motion.
    """

    digest: str
    given: Mapping[str, Any]
    inputs: tuple[str, ...] = ()


def finish(
    scheduler: str | None,
    count: int | None,
    work: Callable[..., Columns],
    cases: Sequence[Case],
    inputs: Mapping[str, Any],
    finished: Finished,
    progress: Callable[..., None],
) -> tuple[int, str]:
    """Start workers if a case is left, compute it, and stop them.

    Args:
        scheduler, count: of ``workers``.
        work, cases, inputs, finished, progress: of ``run``.

    Returns:
        How many cases were computed, and the workers in words, '' where none was needed.
    """
    if finished.has_all(case.digest for case in cases):
        return 0, ''
    progress('starting the workers')
    with workers(scheduler, count) as client:
        told = workers_in_words(client)  # before any of them may end
        return run(client, work, cases, inputs, finished, progress), told


def run(
    client: Client,
    work: Callable[..., Columns],
    cases: Sequence[Case],
    inputs: Mapping[str, Any],
    finished: Finished,
    progress: Progress,
) -> int:
    """Compute the cases that are not finished yet, and return how many those were.

    An input is sent once. It travels as the result of a task of its own: the scheduler can make
    it anew when the only worker that holds it dies, and workers hand it to each other. Cases of a
    worker that dies are run again by another one.

    Args:
        client: of ``workers``.
        work: a function of a module: (given, *inputs of the case) -> equally long columns.
        cases: in any order; of several with one digest, one is run.
        inputs: by name.
        finished: where results are kept.
        progress: called with what is being done and the share of it that is done.

    Raises:
        ManyError: a case ends its worker again and again.
    """
    from distributed import as_completed

    left = {case.digest: case for case in cases if not finished.has(case.digest)}
    sent = _sent(client, {name for case in left.values() for name in case.inputs}, inputs)
    futures: dict[Future, Case] = {
        client.submit(
            _unpacked, work, packed(case.given), *(sent[name] for name in case.inputs),
            key=f'case-{case.digest}', pure=False, retries=1,
        ): case
        for case in left.values()
    }  # fmt: skip
    done = len(cases) - len(left)
    progress(f'{done} of {len(cases)} cases', done / max(len(cases), 1))
    for future in as_completed(list(futures)):
        case = futures.pop(future)
        finished.add(case.digest, _result(future, case))
        future.release()
        done += 1
        progress(f'{done} of {len(cases)} cases', done / len(cases))
    return len(left)


def _sent(client: Client, names: set[str], inputs: Mapping[str, Any]) -> dict[str, Future]:
    # With bytes Dask neither walks through the arrays nor copies them for each worker.
    return {
        name: client.submit(bytes, packed(inputs[name]), key=f'input-{name}', pure=False)
        for name in names
    }


@lru_cache(maxsize=OPENED)
def _opened(content: bytes) -> Any:
    """An input as it was. What it keeps for itself, a search tree say, serves the next case."""
    return pickle.loads(content)


def _unpacked(work: Callable[..., Columns], given: bytes, *inputs: bytes) -> Columns:
    """Run one case in a worker."""
    return work(pickle.loads(given), *map(_opened, inputs))


def _result(future: Future, case: Case) -> Columns:
    from distributed.scheduler import KilledWorker

    try:
        return future.result()
    except KilledWorker as error:
        raise ManyError(
            f'case {case.digest} was given up: {error.allowed_failures + 1} workers ended while '
            'they ran it; give workers more memory, or run fewer of them with --workers'
        ) from None
