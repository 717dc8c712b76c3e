"""A sweep: what it varies, the films of single runs, and nothing computed twice."""

import hashlib
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext

import numpy as np
import pyarrow.parquet as pq
import pytest
import yaml
from scipy.spatial.transform import Rotation

import paint_deposition as pd
from booth import SAMPLES, spot
from cli.command import assert_refused, figures_of, paint, ran
from paint_deposition.batch import sweep_file
from paint_deposition.batch.cases import compute, workers
from paint_deposition.batch.job import Job, computed
from paint_deposition.batch.sweep_file import SweepFile, varied_motion
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import BatchError
from paint_deposition.files.effect_file import effects_allowed
from paint_deposition.model.eq1_pattern import Brush, PlanarPattern
from paint_deposition.motion.path_builder import spray_path
from refusals import refusal

DOOR = SAMPLES / 'measured_door'
EDGE_M = 0.08
SPEEDS, K1 = [0.9, 1.0, 1.1], [1.8, 1.9]
TOLD = {
    'mesh': 'door.stl', 'trajectory': 'door', 'state_topic': '/atomizer/state',
    'max_edge_length_m': EDGE_M, 'readings': 'door.csv',
    'grid': {'planar.K1_cm3_per_s': K1, 'speed_factor': SPEEDS},
}  # fmt: skip


@pytest.fixture
def sweep_path(tmp_path):
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
def test_films_are_those_of_single_runs_by_any_executor(sweep_path, tmp_path, by_itself):
    with ThreadPoolExecutor(2) as threads:
        found = pd.sweep(sweep_path, tmp_path / 'out', threads)
    for values, row in zip(found.job.values, found.table.to_pylist(), strict=True):
        planar = pd.DepositionModel().planar
        planar = planar.model_copy(update={'K1_cm3_per_s': values['planar.K1_cm3_per_s']})
        alone = by_itself(pd.DepositionModel(planar=planar), values['speed_factor'])
        assert row['film_sha256'] == hashlib.sha256(alone.film_um.tobytes()).hexdigest()
        assert row['mean_um'] == alone.statistics.mean_um
        assert row['predicted_um'] == alone.predicted_um.tolist()


@pytest.mark.slow
def test_a_run_that_was_cut_off_computes_the_rest_only(sweep_path, tmp_path, at_worker):
    output = tmp_path / 'out'
    told = figures_of('sweep', sweep_path, '-o', output, *at_worker, '--json')
    assert (told['cases'], told['computed'], told['errors']) == (6, 6, [])
    assert told['judged_by'] == 'sigma_n'
    first = pq.read_table(output / 'cases.parquet')
    kept = sorted((output / 'finished').iterdir())
    kept[2].unlink()
    again = figures_of('sweep', sweep_path, '-o', output, *at_worker, '--json')
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


@pytest.mark.parametrize(('changed', 'words'), [
    ({'grid': {'index_m': [0.2]}}, ['index_m varies planned passes', 'leave trajectory out']),
    ({'mesh': 'none.stl'}, ['none.stl', 'no such mesh file']),
    ({'sample': {'count': 2, 'posterior': True}}, ['no model is given']),
    ({'grid': {'own.gain': [0.1]}}, ["no effect 'own' is in the library or in a model"]),
    (
        {'trajectory': None, 'state_topic': None, 'grid': {'index_m': [0.3]}},
        ['neither their speed nor a target', 'passes: {speed_m_per_s: ...}'],
    ),
])  # fmt: skip
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
    done = ran('sweep', tmp_path / 'sweep.yaml', '-o', tmp_path / 'out', *at_worker)
    assert 'warning: case 1: ' in done.stderr
    assert 'best by unevenness σ_N: case 2, effects []' in done.stdout
    assert (tmp_path / 'out/sweep.png').stat().st_size > 10_000
    told['max_pose_gap_s'] = 1e-3  # the gun is off between all poses
    (tmp_path / 'sweep.yaml').write_text(yaml.safe_dump(told))
    done = paint('sweep', tmp_path / 'sweep.yaml', '-o', tmp_path / 'out', *at_worker)
    assert_refused(done, 'none of 2 cases has a result; case 1: ')


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
    file.write_text(OWN.replace('1.0 + ', '1.0 + 1.5 * '))
    assert Job.of(sweep, DOOR).cases[0][0] != job.cases[0][0]


def swept(**told) -> list[dict]:
    return sweep_file.variations(sweep_file.SweepFile.model_validate(told))


def test_grid_cases_and_draws_are_combined():
    found = swept(
        grid={'index_m': [0.2, 0.3], 'planar.K2': {'first': 0.1, 'last': 0.2, 'steps': 3}},
        cases=[{'effects': []}, {'standoff_m': 0.3}],
        sample={'count': 5, 'vary': {'speed_m_per_s': {'uniform': [0.2, 0.4]}}},
    )
    assert len(found) == 2 * 3 * 2 * 5
    assert sorted({values['planar.K2'] for values in found}) == [0.1, 0.15, 0.2]
    assert all(0.2 <= values['speed_m_per_s'] <= 0.4 for values in found)
    assert len({values['speed_m_per_s'] for values in found}) == 5


def test_draws_repeat_with_their_seed_and_have_the_spread_asked_for():
    sample = {'count': 4000, 'seed': 3, 'vary': {'speed_factor': {'normal': [1.0, 0.02]}}}
    drawn = [values['speed_factor'] for values in swept(sample=sample)]
    assert drawn == [values['speed_factor'] for values in swept(sample=sample)]
    assert abs(np.mean(drawn) - 1.0) < 4 * 0.02 / 4000**0.5
    assert np.std(drawn) == pytest.approx(0.02, rel=4 / 8000**0.5)


@pytest.mark.parametrize(('told', 'words'), [
    ({'grid': {'K1_cm3_per_s': [1.0]}}, "did you mean 'planar.K1_cm3_per_s'"),
    ({'grid': {'air_drift.shift_down': [0.1]}}, "did you mean 'air_drift.shift_down_m'"),
    ({'grid': {'index_m': ['wide']}}, "index_m is 'wide'; expected a number"),
    ({'grid': {'index_m': [-0.1]}}, 'index_m is -0.1; expected a number above 0'),
    ({'grid': {'part_pose': [[0, 0, 0]]}}, 'seven numbers'),
    ({'grid': {'index_m': [0.1]}, 'cases': [{'index_m': 0.2}]}, 'index_m varies twice'),
    ({'sample': {'count': 10}, 'grid': {'index_m': [0.1] * 200_000}}, '2000000 cases'),
    (
        {
            'grid': dict.fromkeys(
                ['index_m', 'standoff_m', 'flow_factor', 'speed_factor'], [0.1] * 2**16
            )
        },
        '18446744073709551616 cases',
    ),
])  # fmt: skip
def test_what_makes_no_sense_is_refused(told, words):
    with pytest.raises(BatchError, match=words.replace('(', r'\(')):
        swept(**told)


@pytest.mark.parametrize(('text', 'words'), [
    ('mesh: a.stl', 'nothing varies; give one of grid, cases, sample'),
    ('gird: {index_m: [0.1]}', "unknown key 'gird'; did you mean 'grid'"),
    (f'grid: {{index_m: {300 * "a"}}}', f"index_m is '{56 * 'a'}...; expected a list"),
    ('grid: {index_m: 0.1}', 'index_m is 0.1; expected a list of at least one value'),
    ('grid: {index_m: {first: 1}}', 'first: A, last: B, steps: N'),
    ('sample: {vary: {}}', "has no 'sample.count'; give how many draws"),
    ('sample: {count: 2, vary: {index_m: {normal: [1, -1]}}}', 'standard deviation'),
    ('[]', 'is not a sweep'),
])  # fmt: skip
def test_a_sweep_file_is_refused_in_a_line(tmp_path, text, words):
    path = tmp_path / 'sweep.yaml'
    path.write_text(text)
    line = refusal(BatchError, sweep_file.read_sweep, path)
    assert words in line
    assert str(path) in line


def test_a_model_is_varied_and_its_bounds_hold():
    varied = sweep_file.varied_model(
        DepositionModel(), {'planar.K1_cm3_per_s': 2.5, 'air_drift.shift_down_m': 0.02}
    )
    assert varied.planar.K1_cm3_per_s == 2.5
    assert varied.effect('air_drift').shift_down_m == 0.02
    assert sweep_file.varied_model(varied, {'effects': []}).effects == ()
    with pytest.raises(BatchError, match=r'K2 is 1\.5'):
        sweep_file.varied_model(DepositionModel(), {'planar.K2': 1.5})
    with pytest.raises(BatchError, match="the model has no effect 'sag'; it has: none"):
        sweep_file.varied_model(DepositionModel(), {'effects': ['sag']})
    brushes = DepositionModel(brushes=[Brush(number=4, planar=PlanarPattern())])
    with pytest.raises(BatchError, match='has a pattern for each brush; give a model'):
        sweep_file.varied_model(brushes, {'planar.K2': 0.2})


def test_a_motion_runs_faster_further_off_and_with_more_flow():
    motion = spot()
    assert sweep_file.varied_motion(motion) is motion
    twice, _ = spray_path(sweep_file.varied_motion(motion, speed_factor=2.0))
    assert twice.spraying_time_s == pytest.approx(0.5 * spray_path(motion)[0].spraying_time_s)
    further = sweep_file.varied_motion(motion, standoff_change_m=0.01)
    tool_z = Rotation.from_quat(motion.quaternions_xyzw).as_matrix()[:, :, 2]
    moved = ((motion.positions_m - further.positions_m) * tool_z).sum(axis=1)
    assert moved == pytest.approx(0.01)
    path, _ = spray_path(sweep_file.varied_motion(motion, flow_factor=1.1))
    assert path.flow.max() == pytest.approx(1.1)
