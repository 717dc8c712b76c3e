"""Work for many processes: what fails is told and tried again, and the rest is computed."""

import json
import os
import subprocess
import sys
import time

import pytest
from distributed import Client

from booth import SAMPLES
from paint_deposition.batch.cases import Case, ResultCache
from paint_deposition.batch.cluster import run, workers
from paint_deposition.batch.sweep.case import computed
from paint_deposition.batch.sweep.job import Job
from paint_deposition.batch.sweep.sweep_file import SweepFile
from paint_deposition.errors import ManyError

DOOR = SAMPLES / 'measured_door'
CASES = 60


@pytest.mark.slow
def test_a_case_that_fails_says_so_and_is_tried_again(tmp_path, worker):
    """`dict` is the work: of the columns of a case, or of a number, which is none."""
    cases = [Case('good', {'mean_um': [20.0]}), Case('bad', 3, known={'part': ['door']})]
    for left in (2, 1):
        finished = ResultCache(tmp_path)
        assert run(worker, dict, cases, {}, finished, lambda what, share: None) == left
        good, bad = finished.table(['good', 'bad']).to_pylist()
        assert (good['mean_um'], good['error']) == (20.0, None)
        assert (bad['part'], bad['mean_um']) == ('door', None)
        assert bad['error'].startswith('not computed: TypeError: ')
    assert [path.name for path in tmp_path.iterdir()] == ['good.parquet']


@pytest.fixture
def cluster(tmp_path):
    """A scheduler with a worker, as processes of their own, and its address."""
    contact = tmp_path / 'scheduler.json'
    found = {'PYTHONPATH': os.pathsep.join(sys.path)}
    quiet = {'stderr': subprocess.DEVNULL, 'env': os.environ | found}
    dask = [sys.executable, '-m', 'dask']
    one = ['--no-dashboard', '--scheduler-file', contact]
    scheduler = subprocess.Popen([*dask, 'scheduler', '--port', '0', *one], **quiet)
    worker = subprocess.Popen([*dask, 'worker', '--no-nanny', '--nthreads', '1', *one], **quiet)
    while not contact.exists():
        time.sleep(0.05)
    address = json.loads(contact.read_text())['address']
    with Client(address) as client:
        client.wait_for_workers(1)
    yield scheduler, address
    for process in (worker, scheduler):
        process.kill()
        process.wait()


@pytest.mark.slow
def test_what_is_finished_is_kept_when_the_scheduler_is_lost(cluster, tmp_path):
    factors = {'first': 0.9, 'last': 1.1, 'steps': CASES}
    told = {'mesh': 'door.stl', 'trajectory': 'door', 'grid': {'speed_factor': factors}}
    job = Job.of(SweepFile.model_validate(told), DOOR)
    scheduler, address = cluster
    finished = ResultCache(tmp_path / 'finished')

    def kill(what: str, share: float) -> None:
        if share > 0.0:
            scheduler.kill()

    refused = pytest.raises(ManyError, match='the scheduler is lost; finished cases are kept')
    with workers(address) as client, refused:
        run(client, computed, job.cases, job.inputs, finished, kill)
    kept = list(finished.folder.iterdir())
    assert 1 <= len(kept) < CASES
