"""A sweep: the films of single runs, and what was finished before is not computed again."""

import hashlib
import json
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext

import pyarrow.parquet as pq
import pytest
import yaml

import paint_deposition as pd
from booth import SAMPLES
from cli.command import assert_refused, paint
from paint_deposition.batch.cases import compute, workers
from paint_deposition.batch.job import Job, computed
from paint_deposition.batch.sweep_file import SweepFile, varied_motion
from paint_deposition.effects.catalogue import effects_allowed

DOOR = SAMPLES / 'measured_door'
EDGE_M = 0.08
SPEEDS, K1 = [0.9, 1.0, 1.1], [1.8, 1.9]
TOLD = {
    'mesh': 'door.stl', 'trajectory': 'door', 'state_topic': '/atomizer/state',
    'max_edge_length_m': EDGE_M, 'readings': 'door.csv',
    'grid': {'planar.K1_cm3_per_s': K1, 'speed_factor': SPEEDS},
}  # fmt: skip


@pytest.fixture
def sweep_file(tmp_path):
    path = tmp_path / 'sweep.yaml'
    inputs = {key: str(DOOR / TOLD[key]) for key in ('mesh', 'trajectory', 'readings')}
    path.write_text(yaml.safe_dump(TOLD | inputs))
    return path


@pytest.fixture(scope='module')
def worker():
    """A worker process of this machine, through its client."""
    with workers(count=1) as client:
        yield client


@pytest.fixture
def at_worker(worker):
    """Options by which a command uses it."""
    return '--scheduler', worker.scheduler.address


@pytest.fixture(scope='module')
def by_itself():
    """`by_itself(model, speed)`: the same film as one run."""
    surface = pd.read_mesh(DOOR / 'door.stl', max_edge_length_m=EDGE_M)
    motion = pd.read_recording(DOOR / 'door', state_topic='/atomizer/state')
    readings = pd.read_readings(DOOR / 'door.csv', surface=surface)
    return lambda model, speed: pd.simulate(
        surface, varied_motion(motion, speed), model, readings=readings
    )


@pytest.mark.slow
def test_films_are_those_of_single_runs_by_any_executor(sweep_file, tmp_path, by_itself):
    with ThreadPoolExecutor(2) as threads:
        found = pd.sweep(sweep_file, tmp_path / 'out', threads)
    for values, row in zip(found.job.values, found.table.to_pylist(), strict=True):
        planar = pd.DepositionModel().planar
        planar = planar.model_copy(update={'K1_cm3_per_s': values['planar.K1_cm3_per_s']})
        alone = by_itself(pd.DepositionModel(planar=planar), values['speed_factor'])
        assert row['film_sha256'] == hashlib.sha256(alone.film_um.tobytes()).hexdigest()
        assert row['mean_um'] == alone.statistics.mean_um
        assert row['predicted_um'] == alone.predicted_um.tolist()


@pytest.mark.slow
def test_a_run_that_was_cut_off_computes_the_rest_only(sweep_file, tmp_path, at_worker):
    output = tmp_path / 'out'
    told = json.loads(paint('sweep', sweep_file, '-o', output, *at_worker, '--json').stdout)
    assert (told['cases'], told['computed'], told['errors']) == (6, 6, [])
    assert told['judged_by'] == 'sigma_n'
    first = pq.read_table(output / 'cases.parquet')
    kept = sorted((output / 'finished').iterdir())
    kept[2].unlink()
    again = json.loads(paint('sweep', sweep_file, '-o', output, *at_worker, '--json').stdout)
    assert again['computed'] == 1
    assert pq.read_table(output / 'cases.parquet').equals(first)
    assert first['speed_factor'].to_pylist() == SPEEDS * 2
    # The film goes as K1 over the speed.
    film = first['painted_volume_cm3'].to_numpy()
    assert film[3:] / film[:3] == pytest.approx(K1[1] / K1[0])
    assert film[0] / film[2] == pytest.approx(SPEEDS[2] / SPEEDS[0], rel=1e-3)
    assert len(pq.read_table(output / 'points.parquet')) == 6 * len(
        pd.read_readings(DOOR / 'door.csv')
    )
    assert (output / 'sweep.png').stat().st_size > 10_000


@pytest.mark.parametrize(
    ('changed', 'words'),
    [
        ({'grid': {'index_m': [0.2]}}, ['index_m varies planned passes', 'leave trajectory out']),
        ({'mesh': 'none.stl'}, ['none.stl', 'no such mesh file']),
        ({'sample': {'count': 2, 'posterior': True}}, ['no model is given']),
        ({'grid': {'own.gain': [0.1]}}, ["no effect 'own' is in the library or in a model"]),
        (
            {'trajectory': None, 'state_topic': None, 'grid': {'index_m': [0.3]}},
            ['neither their speed nor a target', 'passes: {speed_m_per_s: ...}'],
        ),
    ],
)
def test_what_does_not_go_together_is_refused_before_any_process_starts(tmp_path, changed, words):
    path = tmp_path / 'sweep.yaml'
    inputs = {key: str(DOOR / TOLD[key]) for key in ('mesh', 'trajectory', 'readings')}
    path.write_text(yaml.safe_dump(TOLD | inputs | changed))
    assert_refused(paint('sweep', path, '-o', tmp_path / 'out'), *words)
    assert not (tmp_path / 'out').exists()


@pytest.mark.slow
def test_what_cannot_be_painted_says_why_and_the_rest_is_drawn(tmp_path, at_worker):
    """Names of files and lists of effects are drawn over, too; a bare part is no best case."""
    told = {'max_edge_length_m': EDGE_M, 'cases': [{'standoff_change_m': 30.0}, {'effects': []}]}
    told |= {key: str(DOOR / TOLD[key]) for key in ('mesh', 'trajectory')}
    (tmp_path / 'sweep.yaml').write_text(yaml.safe_dump(told))
    done = paint('sweep', tmp_path / 'sweep.yaml', '-o', tmp_path / 'out', *at_worker)
    assert done.returncode == 0, done.stderr
    assert 'warning: case 1: ' in done.stderr
    assert 'best by unevenness σ_N: case 2, effects []' in done.stdout
    assert (tmp_path / 'out/sweep.png').stat().st_size > 10_000
    told['cases'] = told['cases'][:1]
    (tmp_path / 'sweep.yaml').write_text(yaml.safe_dump(told))
    done = paint('sweep', tmp_path / 'sweep.yaml', '-o', tmp_path / 'out', *at_worker)
    assert_refused(done, 'none of 1 cases has a result; case 1: ')


OWN = """
from paint_deposition.effects.base import Effect, parameter

class Own(Effect):
    id = 'own'
    family = 'incidence'
    gain: float = parameter(0.0, low=-1.0, high=1.0, typical=0.1, unit='1', description='gain')

    def on_film(self, film_um, points):
        return (1.0 + self.gain * points.height_fraction) * film_um
"""


@pytest.fixture
def with_leave():
    """As with --allow-effects."""
    token = effects_allowed.set(True)
    yield
    effects_allowed.reset(token)


@pytest.mark.slow
@pytest.mark.usefixtures('with_leave')
def test_a_users_own_effect_travels_to_processes_that_have_not_its_file(
    tmp_path, by_itself, worker
):
    """Its parameters vary like any others, and its text is part of what a case is known by."""
    file, model_file = tmp_path / 'own.py', tmp_path / 'model.yaml'
    file.write_text(OWN)
    model_file.write_text('effects:\n  - {file: own.py, gain: 0.5}\n')
    varied = {'model': [str(model_file)], 'speed_factor': SPEEDS[:1], 'own.gain': [0.5, -0.25]}
    told = TOLD | {'grid': varied}
    sweep = SweepFile.model_validate(told)
    job = Job.of(sweep, DOOR)
    alone = by_itself(pd.read_model(model_file), SPEEDS[0])
    file.unlink()
    table, _ = compute(
        computed, job.cases, job.inputs, tmp_path, nullcontext(worker), lambda what, share: None
    )
    as_told, weaker = table.to_pylist()
    assert as_told['film_sha256'] == hashlib.sha256(alone.film_um.tobytes()).hexdigest()
    assert weaker['mean_um'] < as_told['mean_um']
    file.write_text(OWN.replace('1.0 + ', '1.5 + '))
    assert Job.of(sweep, DOOR).cases[0].digest != job.cases[0].digest
