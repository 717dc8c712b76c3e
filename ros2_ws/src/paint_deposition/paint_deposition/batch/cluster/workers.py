"""The workers: processes of this machine with one thread each, or those of a scheduler."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import paint_deposition
from paint_deposition.errors import ManyError

if TYPE_CHECKING:
    from distributed import Client

# One thread a process: the cases are what runs side by side.
ONE_THREAD = dict.fromkeys(
    ('NUMBA_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'MKL_NUM_THREADS'), '1'
)
CONNECT_S = 30
GIBIBYTE = 1 << 30


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
        # Of a lost connection the caller tells in a line.
        with silence_logging_cmgr(logging.CRITICAL), client:
            _require_same_version(client, scheduler)
            yield client


def workers_in_words(client: Client) -> str:
    """'4 worker processes of 1 thread and 3.9 GiB each at tcp://127.0.0.1:40001'."""
    info = client.scheduler_info(n_workers=-1)
    found = list(info['workers'].values())
    threads = sorted({worker['nthreads'] for worker in found})
    memory = [worker['memory_limit'] for worker in found]
    each = f'{min(memory) / GIBIBYTE:.1f} GiB' if all(memory) else 'unlimited memory'
    shown = '-'.join(map(str, threads)) or '0'
    return (
        f'{len(found)} worker process{"" if len(found) == 1 else "es"}, {shown} '
        f'thread{"" if shown == "1" else "s"} and {each} each, at {info["address"]}'
    )


def require_alone(scheduler: str | None, count: int | None) -> None:
    """Refuse a number of processes beside a scheduler, which has its own.

    Raises:
        ManyError: both are given.
    """
    if scheduler is not None and count is not None:
        raise ManyError('--workers is for this machine; leave it out beside --scheduler')


def _require_same_version(client: Client, scheduler: str) -> None:
    """Films are the same on all workers only if all run the same code."""
    versions = client.run(_version)
    if not versions:
        raise ManyError(
            f'the scheduler at {scheduler} has no worker; start some with '
            f'`dask worker {scheduler} --nthreads 1`'
        )
    for worker, version in versions.items():
        if version != paint_deposition.__version__:
            raise ManyError(
                f'worker {worker} has paint_deposition {version}, this is '
                f'{paint_deposition.__version__}; install the same everywhere'
            )


def _version() -> str:
    return paint_deposition.__version__
