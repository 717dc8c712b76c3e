"""Cases of a sweep, computed by an executor; each result is kept as soon as it is there.

The files are our own: joblib keeps pickles under a digest of the function's text alone, while
these are Parquet tables that a user opens, found again only by the same code of the whole package.
"""

from __future__ import annotations

import copyreg
import hashlib
import io
import logging
import pickle
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, Executor, Future, ThreadPoolExecutor, as_completed
from contextlib import AbstractContextManager, contextmanager
from functools import cache, lru_cache, partial
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from socket import gethostname
from typing import TYPE_CHECKING, Any

import paint_deposition
from paint_deposition.effects.base import Effect
from paint_deposition.errors import BatchError
from paint_deposition.files.atomic import json_text, write_parquet
from paint_deposition.files.effect_file import effect_of

if TYPE_CHECKING:
    import pyarrow as pa
    from distributed import Client

Columns = Mapping[str, Any]
# How long a scheduler may take to answer, and to have a worker.
CONNECT_S = 30
# The digest of all that a case is computed from, of which none is computed twice; its own, small
# parameters; and the names of what it shares with others, such as a part or a motion.
Case = tuple[str, Any, Sequence[str]]


def compute(
    work: Callable[..., Columns],
    cases: Sequence[Case],
    inputs: Mapping[str, Any],
    folder: Path,
    executor: AbstractContextManager[Executor | Client],
    progress: Callable[[str, float], None],
) -> tuple[pa.Table, int]:
    """Compute the cases that are not finished yet.

    A case that ends its workers again and again, or fails in an unforeseen way, has the reason in
    its column ``error`` and is tried again by the next run.

    Args:
        work: a function of a module: (parameters, *inputs of the case) -> equally long columns.
        cases: in any order; of several with one digest, one is run.
        inputs: by name.
        folder: of finished cases, a Parquet file for each, written as a whole.
        executor: what computes them; entered where a case is left.
        progress: called with what is being done and the share of it that is done.

    Returns:
        The rows of all cases in their order, and how many were computed now. Columns that a case
        lacks are empty in its rows.

    Raises:
        BatchError: another command uses the folder, a worker has other code, or the scheduler is
            lost. What is finished is kept.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq
    from filelock import FileLock, Timeout

    folder.mkdir(parents=True, exist_ok=True)
    try:  # the system frees it when a command dies
        alone = FileLock(folder / '.lock', timeout=0).acquire()
    except Timeout:
        raise BatchError(
            f'{folder} is in use by another command; wait for it, or choose another --output'
        ) from None
    files = {digest: folder / f'{digest}.parquet' for digest, *_ in cases}
    failures = {}
    with alone:
        once = {case[0]: case for case in cases}
        left = [case for digest, case in once.items() if not files[digest].is_file()]
        done = len(cases) - len(left)
        for digest, future in finished(work, left, inputs, executor) if left else ():
            try:
                write_parquet(files[digest], pa.table(dict(future.result())))
            except CancelledError:
                raise BatchError(
                    'the scheduler is lost; finished cases are kept, run the same command again'
                ) from None
            except BatchError:
                raise
            except Exception as error:
                failure = f'not computed: {type(error).__name__}: {" ".join(str(error).split())}'
                failures[digest] = pa.table({'error': [failure]})
            done += 1
            progress(f'{done} of {len(cases)} cases', done / len(cases))
        rows = [failures.get(c) or pq.read_table(files[c]) for c, *_ in cases]
    return pa.concat_tables(rows, promote_options='permissive'), len(left)


@contextmanager
def workers(scheduler: str | None = None, count: int | None = None) -> Iterator[Client | Executor]:
    """Connect to a scheduler of Dask, or start processes of one thread that end with the block.

    Without Dask, this process computes, a case at a time.

    Args:
        scheduler: address, 'tcp://10.0.0.5:8786'; default: that of Dask's own settings, such as
            the variable DASK_SCHEDULER_ADDRESS, unless there is a count.
        count: of processes on this machine; default: one a core that this process may use.

    Raises:
        BatchError: no scheduler answers, or it has no worker.
    """
    if find_spec('distributed') is None:
        with ThreadPoolExecutor(1) as pool:
            yield pool
        return
    import dask
    from distributed import Client, LocalCluster
    from distributed.utils import silence_logging_cmgr

    if scheduler is None and count is None:
        scheduler = dask.config.get('scheduler-address', None)
    if scheduler is None:
        # A case for each worker and no more in store: a case that ends its worker is blamed alone.
        with (
            dask.config.set({'distributed.scheduler.worker-saturation': 1.0}),
            LocalCluster(
                n_workers=count, threads_per_worker=1, processes=True,
                dashboard_address='127.0.0.1:0', silence_logs=logging.CRITICAL,
                env={'NUMBA_NUM_THREADS': '1'},
            ) as cluster,
            Client(cluster) as client,
        ):  # fmt: skip
            yield client
        return
    # What is lost or refused becomes an error of one line.
    with silence_logging_cmgr(logging.CRITICAL):
        try:
            client = Client(scheduler, timeout=CONNECT_S)
        except (OSError, TimeoutError, ValueError) as error:
            raise BatchError(
                f'no scheduler answers at {scheduler} ({type(error).__name__}); start one with '
                '`dask scheduler`'
            ) from None
        with client:
            try:
                client.wait_for_workers(1, timeout=CONNECT_S)
            except TimeoutError:
                raise BatchError(
                    f'the scheduler at {scheduler} has no worker; start one for each core with '
                    f'`dask worker {scheduler} --nthreads 1`'
                ) from None
            yield client


def digest_of(*values: Any) -> str:
    """32 hexadecimal digits of SHA-256 for values that JSON can hold."""
    return hashlib.sha256(json_text({'values': values}).encode()).hexdigest()[:32]


@cache
def code_digest() -> str:
    """A digest of all sources of the package and the versions of what computes its films."""
    from paint_deposition.kernel.compiler import KIND

    package = Path(paint_deposition.__file__).parent
    digest = hashlib.sha256(f'{paint_deposition.__version__} for {KIND}'.encode())
    for library in ('numba', 'numpy', 'scipy'):
        digest.update(version(library).encode())
    for file in sorted(package.rglob('*.py')):
        digest.update(str(file.relative_to(package)).encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()[:32]


def finished(
    work: Callable[..., Any],
    cases: Sequence[Case],
    inputs: Mapping[str, Any],
    executor: AbstractContextManager[Any],
) -> Iterator[tuple[str, Future]]:
    """Submit the cases, as ``compute`` does, and return the digest of each when it is done."""
    futures: dict[Future, str] = {}
    with executor as pool:
        place: Callable[[bytes], Any] = bytes
        if hasattr(pool, 'get_executor'):
            # Dask sends the result of a task to each worker once, and computes it again where the
            # only worker that holds it dies.
            place, pool = partial(pool.submit, bytes, pure=False), pool.get_executor(pure=False)
        names = {name for *_, shared in cases for name in shared}
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')  # of Dask: inputs are large
            placed = {name: place(_serialised(inputs[name])) for name in names}
        try:
            for digest, parameters, shared in cases:
                given = _serialised(parameters), *(placed[name] for name in shared)
                futures[pool.submit(_run_case, code_digest(), work, *given)] = digest
            for future in as_completed(list(futures)):
                yield futures.pop(future), future
        finally:
            for future in futures:
                future.cancel()


def _run_case(code: str, work: Callable[..., Any], parameters: bytes, *inputs: bytes) -> Any:
    """Compute a case in a worker, which may have joined at any time."""
    if code != code_digest():  # films are the same only by the same code
        raise BatchError(
            f'a worker on {gethostname()} has another paint_deposition '
            f'({paint_deposition.__version__}), Numba, NumPy or SciPy, or kind of processor; '
            'install the same there, and set NUMBA_CPU_NAME=x86-64-v3 everywhere'
        )
    return work(pickle.loads(parameters), *map(_deserialised, inputs))


# The inputs that a worker keeps: what one caches, such as a search tree, serves the next case too.
_deserialised = lru_cache(maxsize=8)(pickle.loads)


def _serialised(value: Any) -> bytes:
    """Bytes that ``pickle.loads`` opens elsewhere; the files of users' effects run there."""
    content = io.BytesIO()
    pickler = pickle.Pickler(content, protocol=5)
    pickler.dispatch_table = copyreg.dispatch_table | {type(Effect): _class_reduced}
    pickler.dump(value)
    return content.getvalue()


def _class_reduced(model: Any) -> Any:
    """How to make the class of a user's effect elsewhere; the name of any other."""
    file = getattr(model, 'file', None)
    return (effect_of, (file, model.file_content)) if file else model.__qualname__
