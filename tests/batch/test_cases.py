"""Cases by workers of Dask, here and behind a scheduler, and by any other executor."""

import os
import shutil
import socket
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, nullcontext
from pathlib import Path

import pytest
import yaml

import paint_deposition
from booth import SAMPLES
from cli.command import assert_refused, paint
from paint_deposition.batch.cases import compute, workers
from paint_deposition.batch.job import Job, computed
from paint_deposition.batch.sweep_file import SweepFile
from paint_deposition.errors import BatchError

pytestmark = pytest.mark.slow
TOLD = {'mesh': 'panel.stl', 'trajectory': 'panel_577', 'max_edge_length_m': 0.1}
CASES = 80
FILM = "{'mean_um': [20.0]}"


def silent(what: str, share: float) -> None:
    """Show no progress."""


@pytest.fixture
def address():
    """Where a scheduler of the test may listen."""
    with socket.socket() as free:
        free.bind(('127.0.0.1', 0))
        return 'tcp://{}:{}'.format(*free.getsockname())


@pytest.fixture
def dask(address, tmp_path):
    """`dask('scheduler')` and `dask('worker')` start processes, which end with the test."""
    kinds = {
        'scheduler': ('--host', address, '--no-dashboard'),
        # Without the guardian that would start it again.
        'worker': (address, '--nthreads', '1', '--no-nanny', '--no-dashboard'),
    }
    with ExitStack() as started:

        def start(kind: str, *sources: Path) -> subprocess.Popen:
            path = os.pathsep.join(map(str, (*sources, *sys.path)))
            process = subprocess.Popen(
                [sys.executable, '-m', 'dask', kind, *kinds[kind]], stderr=subprocess.DEVNULL,
                env=os.environ | {'PYTHONPATH': path, 'NUMBA_NUM_THREADS': '1'}, cwd=tmp_path,
            )  # fmt: skip
            started.callback(process.wait)
            started.callback(process.kill)
            return process

        yield start


def test_films_are_those_of_this_process_though_worker_and_scheduler_die(address, dask, tmp_path):
    grid = {'speed_factor': {'first': 0.9, 'last': 1.1, 'steps': CASES}}
    job = Job.of(SweepFile.model_validate(TOLD | {'grid': grid}), SAMPLES)

    def swept(folder: str, executor, progress=silent):
        return compute(computed, job.cases, job.inputs, tmp_path / folder, executor, progress)

    processes = [dask(kind) for kind in ('scheduler', 'worker', 'worker')]

    def kill(what: str, share: float) -> None:
        if share > 0.1:
            processes[1].kill()
        if share > 0.5:
            processes[0].kill()

    with pytest.raises(BatchError, match='the scheduler is lost; finished cases are kept'):
        swept('far', workers(address), kill)
    finished = len([*(tmp_path / 'far').glob('*.parquet')])
    assert CASES / 2 < finished < CASES
    processes[0].wait()
    for kind in ('scheduler', 'worker'):
        dask(kind)
    far, now = swept('far', workers(address))
    assert now == CASES - finished
    here, now = swept('here', nullcontext(ThreadPoolExecutor(1)))
    assert now == CASES
    assert far.equals(here)
    assert len({*far['film_sha256'].to_pylist()}) == CASES


def test_a_worker_with_another_version_is_refused(address, dask, tmp_path):
    package = Path(paint_deposition.__file__).parent
    other = shutil.copytree(package, tmp_path / 'other' / package.name)
    text = (other / '__init__.py').read_text()
    (other / '__init__.py').write_text(text.replace(paint_deposition.__version__, '0.0.1'))
    dask('scheduler')
    dask('worker', other.parent)
    told = TOLD | {'grid': {'speed_factor': [0.9, 1.1]}}
    told |= {key: str(SAMPLES / TOLD[key]) for key in ('mesh', 'trajectory')}
    (tmp_path / 'sweep.yaml').write_text(yaml.safe_dump(told))
    refused = paint('sweep', tmp_path / 'sweep.yaml', '-o', tmp_path, '--scheduler', address)
    assert_refused(refused, 'has another paint_deposition (0.0.1)', 'install the same there')


def test_a_case_that_fails_says_so_and_is_tried_again(tmp_path):
    """`eval` is the work: of columns, of what raises, of what ends its process."""
    texts = {'deadly': "__import__('os')._exit(1)", 'bad': '1 / 0'}
    texts |= {f'good_{number}': FILM for number in range(8)}
    cases = [(name, text, ()) for name, text in texts.items()]
    for left in (10, 2):
        table, now = compute(eval, cases, {}, tmp_path, workers(count=2), silent)
        assert now == left
        deadly, bad, *good = table.to_pylist()
        assert good == 8 * [{'mean_um': 20.0, 'error': None}]
        assert bad['error'] == 'not computed: ZeroDivisionError: division by zero'
        assert deadly['error'].startswith('not computed: KilledWorker: ')
    assert {path.stem for path in tmp_path.glob('*.parquet')} == {*texts} - {'deadly', 'bad'}


def test_a_folder_is_of_one_command_at_a_time_and_without_dask_this_process_computes(
    tmp_path, monkeypatch
):
    monkeypatch.setattr('paint_deposition.batch.cases.find_spec', lambda name: None)
    given = eval, [(name, FILM, ()) for name in ('good', 'again', 'good')], {}, tmp_path

    def second(what: str, share: float) -> None:
        with pytest.raises(BatchError, match='is in use by another command'):
            compute(*given, workers(), silent)

    table, now = compute(*given, workers(), second)
    assert (table.num_rows, now) == (3, 2)
    assert compute(*given, workers(), second)[1] == 0
