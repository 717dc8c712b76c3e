"""Cases computed by workers: processes of this machine, or those of a Dask scheduler.

Each result is kept as soon as it is there, so that a run that is cut off is resumed.
"""

from __future__ import annotations

import logging
import os
import pickle
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import paint_deposition
from paint_deposition.batch.cases import Case, Columns, ResultCache, serialised
from paint_deposition.errors import ManyError

if TYPE_CHECKING:
    from distributed import Client, Future

# One thread a process: the cases are what runs side by side.
ONE_THREAD = dict.fromkeys(
    ('NUMBA_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'MKL_NUM_THREADS'), '1'
)
CONNECT_S = 30
# Inputs that a worker keeps in memory.
INPUTS_KEPT = 8


def compute(
    scheduler: str | None,
    count: int | None,
    work: Callable[..., Columns],
    cases: Sequence[Case],
    inputs: Mapping[str, Any],
    results: ResultCache,
    progress: Callable[..., None],
) -> tuple[int, str]:
    """Start workers if a case is left, and ``run``: the number computed, the workers in words."""
    if all(results.has(case.digest) for case in cases):
        return 0, 'none: every case was finished already'
    progress('starting the workers')
    with workers(scheduler, count) as client:
        info = client.scheduler_info(n_workers=-1)
        described = f'{len(info["workers"])} worker processes at {info["address"]}'
        return run(client, work, cases, inputs, results, progress), described


@contextmanager
def workers(scheduler: str | None = None, count: int | None = None) -> Iterator[Client]:
    """Connect to a scheduler, or start as many processes here; they end with the block.

    Args:
        scheduler: address as `dask scheduler` prints it, 'tcp://10.0.0.5:8786'; None starts a
            scheduler and workers on this machine.
        count: of the processes on this machine; default: one a core that this process may use.

    Raises:
        ManyError: no scheduler answers, it has no worker, or a worker has another version.
    """
    import dask
    from distributed import Client, LocalCluster
    from distributed.utils import silence_logging_cmgr

    # Inputs travel with the tasks that hold them, see ``run``; they are large on purpose.
    settings = {
        'distributed.admin.large-graph-warning-threshold': '10GB',
        'distributed.comm.timeouts.connect': f'{CONNECT_S}s',
        'distributed.nanny.pre-spawn-environ': ONE_THREAD,
    }
    with dask.config.set(settings):
        if scheduler is None:
            with (
                LocalCluster(
                    n_workers=count or len(os.sched_getaffinity(0)), threads_per_worker=1,
                    processes=True, dashboard_address='127.0.0.1:0', silence_logs=logging.CRITICAL,
                ) as cluster,
                Client(cluster) as client,
            ):  # fmt: skip
                yield client
            return
        try:
            client = Client(scheduler, timeout=f'{CONNECT_S}s')
        except (OSError, TimeoutError, ValueError) as error:
            raise ManyError(
                f'no scheduler answers at {scheduler} ({type(error).__name__}); start one with '
                '`dask scheduler`, and workers with `dask worker ADDRESS --nthreads 1`'
            ) from None
        # A lost connection becomes an error of one line in ``run``.
        with silence_logging_cmgr(logging.CRITICAL), client:
            own, theirs = _version(), set(client.run(_version).values())
            if theirs != {own}:  # films are the same only by the same code
                raise ManyError(
                    f'versions of the workers at {scheduler}: '
                    f'{", ".join(sorted(theirs)) or "no worker"}, this is {own}; '
                    f'start `dask worker {scheduler} --nthreads 1` with the same version'
                )
            yield client


def _version() -> str:
    return paint_deposition.__version__


def run(
    client: Client,
    work: Callable[..., Columns],
    cases: Sequence[Case],
    inputs: Mapping[str, Any],
    results: ResultCache,
    progress: Callable[[str, float], None],
) -> int:
    """Compute the cases that are not finished yet, and return how many those were.

    An input is sent once, as the result of a task of its own: the scheduler can recompute it when
    the only worker that holds it dies. Cases of a worker that dies are run again by another one. A
    case that ends its worker again and again, or fails in an unforeseen way, has the
    reason in its column ``error`` and is tried again by the next run.

    Args:
        client: of ``workers``.
        work: a function of a module: (given, *inputs of the case) -> equally long columns.
        cases: in any order; of several with one digest, one is run.
        inputs: by name.
        results: where they are kept.
        progress: called with what is being done and the share of it that is done.

    Raises:
        ManyError: the scheduler is lost. Where all workers are, it waits for new ones.
    """
    from distributed import as_completed

    left = {case.digest: case for case in cases if not results.has(case.digest)}
    # As bytes: Dask neither walks through the arrays nor copies them for each worker.
    sent = {
        name: client.submit(bytes, serialised(inputs[name]), key=f'input-{name}', pure=False)
        for name in {name for case in left.values() for name in case.inputs}
    }
    futures: dict[Future, Case] = {
        client.submit(
            _run_case, work, serialised(case.parameters), *(sent[name] for name in case.inputs),
            key=f'case-{case.digest}', pure=False, retries=1,
        ): case
        for case in left.values()
    }  # fmt: skip
    done = len(cases) - len(left)
    progress(f'{done} of {len(cases)} cases', done / max(len(cases), 1))
    for future in as_completed(list(futures)):
        case = futures.pop(future)
        columns, failure = _result(future)
        if failure is None:
            results.add(case.digest, columns)
        else:
            results.failures[case.digest] = {**case.known, 'error': [failure]}
        future.release()
        done += 1
        progress(f'{done} of {len(cases)} cases', done / len(cases))
    return len(left)


@lru_cache(maxsize=INPUTS_KEPT)
def _deserialised(content: bytes) -> Any:
    """An input; what it caches, such as a search tree, serves the next case too."""
    return pickle.loads(content)


def _run_case(work: Callable[..., Columns], parameters: bytes, *inputs: bytes) -> Columns:
    """Run one case in a worker."""
    return work(pickle.loads(parameters), *map(_deserialised, inputs))


def _result(future: Future) -> tuple[Columns, str | None]:
    """The columns of a case, or why there are none. Raises ManyError: the scheduler is lost."""
    from distributed.scheduler import KilledWorker

    try:
        return future.result(), None
    except CancelledError:
        raise ManyError(
            'the scheduler is lost; finished cases are kept, run the same command again'
        ) from None
    except KilledWorker as error:
        return {}, (
            f'not computed: {error.allowed_failures + 1} workers ended while they computed it; '
            'give workers more memory, or run fewer of them with --workers'
        )
    except Exception as error:
        return {}, f'not computed: {type(error).__name__}: {" ".join(str(error).split())}'
