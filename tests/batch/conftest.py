"""One worker for all that need some."""

import pytest


@pytest.fixture(scope='session')
def worker():
    """A worker process on this machine, through its client."""
    from paint_deposition.batch.cluster import workers

    with workers(count=1) as client:
        yield client


@pytest.fixture
def at_worker(worker):
    """Options by which a command uses it."""
    return '--scheduler', worker.scheduler.address
