"""Cases computed side by side, in processes of this machine.

Each result is kept as soon as it is there, so that a run that is cut off is resumed.
"""

from __future__ import annotations

import os
import pickle
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from functools import lru_cache
from multiprocessing import get_context, parent_process
from threading import Thread
from typing import Any

from paint_deposition.batch.cases import Case, Columns, ResultCache, serialised

# One thread a process: the cases are what runs side by side.
ONE_THREAD = dict.fromkeys(
    ('NUMBA_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'MKL_NUM_THREADS'), '1'
)
# Inputs that a process keeps open.
INPUTS_KEPT = 8


def compute(
    work: Callable[..., Columns],
    cases: Sequence[Case],
    inputs: Mapping[str, Any],
    results: ResultCache,
    progress: Callable[[str, float], None],
    count: int | None = None,
) -> int:
    """Compute the cases that are not finished yet, and return how many those were.

    Where a process dies, the cases that are left go on in half as many: memory is what it lacked
    as a rule. A case that ends a process of its own, or fails in an unforeseen way, has the reason
    in its column ``error`` and is tried again by the next run.

    Args:
        work: a function of a module: (given, *inputs of the case) -> equally long columns.
        cases: in any order; of several with one digest, one is run.
        inputs: by name.
        results: where they are kept.
        progress: called with what is being done and the share of it that is done.
        count: of processes; default: one a core that this process may use.
    """
    left = {case.digest: case for case in cases if not results.has(case.digest)}
    todo = len(left)
    needed = {name for case in left.values() for name in case.inputs}
    sent = {name: serialised(inputs[name]) for name in needed}

    def end(case: Case, failure: str | None = None) -> None:
        if failure is not None:
            results.failures[case.digest] = {**case.known, 'error': [f'not computed: {failure}']}
        del left[case.digest]
        done = len(cases) - len(left)
        progress(f'{done} of {len(cases)} cases', done / len(cases))

    most = side_by_side = count or len(os.sched_getaffinity(0))
    while left:
        with processes(min(side_by_side, len(left)), sent) as pool:
            futures = {}
            with suppress(BrokenProcessPool):
                for case in left.values():
                    given = work, serialised(case.parameters), case.inputs
                    futures[pool.submit(_run_case, *given)] = case
            for future in as_completed(list(futures)):
                case = futures.pop(future)
                try:
                    columns = future.result()
                except BrokenProcessPool:
                    continue
                except Exception as error:
                    end(case, f'{type(error).__name__}: {" ".join(str(error).split())}')
                else:
                    results.add(case.digest, columns)
                    end(case)
        if left and side_by_side > 1:
            side_by_side //= 2
        elif left:  # by itself, the first of them is the one that the process died of
            end(
                next(iter(left.values())),
                'its process ended, for lack of memory as a rule: make it smaller',
            )
            side_by_side = most
    return todo


@contextmanager
def processes(count: int, inputs: Mapping[str, bytes]) -> Iterator[ProcessPoolExecutor]:
    """So many processes of one thread each; at the end, what they have not begun is left."""
    before = {name: os.environ[name] for name in ONE_THREAD if name in os.environ}
    pool = ProcessPoolExecutor(count, get_context('spawn'), _begin, (inputs,))
    os.environ.update(ONE_THREAD)
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)
        for name in ONE_THREAD:
            del os.environ[name]
        os.environ.update(before)


_sent: dict[str, bytes] = {}


def _begin(inputs: Mapping[str, bytes]) -> None:
    """Begin a process: with the inputs of its cases, and ending with the command, however."""
    _sent.update(inputs)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the command ends them
    Thread(target=_end_with_the_command, daemon=True).start()


def _end_with_the_command() -> None:
    if command := parent_process():
        command.join()
    os._exit(1)


@lru_cache(maxsize=INPUTS_KEPT)
def _input(name: str) -> Any:
    """An input; what it caches, such as a search tree, serves the next case too."""
    return pickle.loads(_sent[name])


def _run_case(work: Callable[..., Columns], parameters: bytes, inputs: Sequence[str]) -> Columns:
    return work(pickle.loads(parameters), *map(_input, inputs))
