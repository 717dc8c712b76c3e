"""Cases computed by workers, each kept as soon as it is there."""

from __future__ import annotations

import pickle
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from paint_deposition.batch.cluster.finished import Columns, Finished
from paint_deposition.batch.cluster.packing import packed
from paint_deposition.batch.cluster.workers import workers, workers_in_words
from paint_deposition.errors import ManyError

if TYPE_CHECKING:
    from distributed import Client, Future

Progress = Callable[[str, float], None]
# Inputs that a worker keeps open.
OPENED = 8
# How often results are looked for, and workers; and for how long there may be none.
RESULTS_S, WORKERS_S, PATIENCE_S = 0.02, 3.0, 60.0
AGAIN = 'finished cases are kept, run the same command again'


@dataclass(frozen=True)
class Case:
    """One piece of work.

    Attributes:
        digest: of all that it is computed from; the same digest is never computed twice.
        given: what is its own, small.
        inputs: names of what it shares with others, such as a part or a motion.
        about: columns of its row that are known without computing it.
    """

    digest: str
    given: Mapping[str, Any]
    inputs: tuple[str, ...] = ()
    about: Mapping[str, Any] = field(default_factory=dict)


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
    worker that dies are run again by another one. A case that ends its worker again and again, or
    fails in a way that is not foreseen, says so in its column ``error`` and is tried again by the
    next run.

    Args:
        client: of ``workers``.
        work: a function of a module: (given, *inputs of the case) -> equally long columns.
        cases: in any order; of several with one digest, one is run.
        inputs: by name.
        finished: where results are kept.
        progress: called with what is being done and the share of it that is done.

    Raises:
        ManyError: the scheduler, or all workers, are lost.
    """
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
    for future in _as_done(client, list(futures)):
        case = futures.pop(future)
        columns, why_not = _result(future)
        if why_not is None:
            finished.add(case.digest, columns)
        else:
            finished.give_up(case.digest, {**case.about, 'error': [why_not]})
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


def _as_done(client: Client, futures: Sequence[Future]) -> Iterator[Future]:
    """The futures in the order in which they are done.

    Raises:
        ManyError: there has been no worker for a while.
    """
    from distributed import as_completed

    coming = as_completed(futures)
    looked_s = there_s = time.monotonic()
    while not coming.is_empty():
        if coming.has_ready():
            yield next(coming)
            continue
        time.sleep(RESULTS_S)
        now_s = time.monotonic()
        if now_s < looked_s + WORKERS_S:
            continue
        looked_s = now_s
        # Of a scheduler that is lost the futures tell.
        with suppress(OSError):
            if client.scheduler_info(n_workers=-1)['workers']:
                there_s = now_s
        if now_s > there_s + PATIENCE_S:
            raise ManyError(f'no worker has been there for {PATIENCE_S:.0f} s; {AGAIN}')


def _result(future: Future) -> tuple[Columns, str | None]:
    """The columns of a case, or why there are none.

    Raises:
        ManyError: the scheduler is lost.
    """
    from distributed.scheduler import KilledWorker

    try:
        return future.result(), None
    except CancelledError:
        raise ManyError(f'the scheduler is lost; {AGAIN}') from None
    except KilledWorker as error:
        return {}, (
            f'given up: {error.allowed_failures + 1} workers ended while they computed it; give '
            'workers more memory, or run fewer of them with --workers'
        )
    except Exception as error:
        return {}, f'not computed: {type(error).__name__}: {" ".join(str(error).split())}'
