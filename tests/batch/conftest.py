"""One worker for all commands that need some."""

import pytest


@pytest.fixture(scope='session')
def at_worker():
    """Options by which a command uses a worker that is there already."""
    from paint_deposition.batch.cluster import workers

    with workers(count=1) as client:
        yield '--scheduler', client.scheduler.address
