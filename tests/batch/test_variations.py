"""What a sweep file varies, and how it is refused."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from booth import spot
from paint_deposition.batch import sweep_file
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import BatchError
from paint_deposition.model.eq1_pattern import Brush, PlanarPattern
from paint_deposition.motion.path_builder import spray_path


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


@pytest.mark.parametrize(
    ('told', 'words'),
    [
        ({'grid': {'K1_cm3_per_s': [1.0]}}, "did you mean 'planar.K1_cm3_per_s'"),
        ({'grid': {'air_drift.shift_down': [0.1]}}, "did you mean 'air_drift.shift_down_m'"),
        ({'grid': {'index_m': ['wide']}}, "index_m is 'wide'; expected a number"),
        ({'grid': {'index_m': [-0.1]}}, 'index_m is -0.1; expected a number above 0'),
        ({'grid': {'part_pose': [[0, 0, 0]]}}, 'seven numbers'),
        ({'grid': {'index_m': [0.1]}, 'cases': [{'index_m': 0.2}]}, 'index_m varies twice'),
        ({'sample': {'count': 10}, 'grid': {'index_m': [0.1] * 200_000}}, '2000000 cases'),
    ],
)
def test_what_makes_no_sense_is_refused(told, words):
    with pytest.raises(BatchError, match=words.replace('(', r'\(')):
        swept(**told)


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('mesh: a.stl', 'nothing varies; give one of grid, cases, sample'),
        ('gird: {index_m: [0.1]}', "unknown key 'gird'; did you mean 'grid'"),
        ('grid: {index_m: 0.1}', 'index_m is 0.1; expected a list of at least one value'),
        ('grid: {index_m: {first: 1}}', 'first: A, last: B, steps: N'),
        ('sample: {vary: {}}', "has no 'sample.count'; give how many draws"),
        ('sample: {count: 2, vary: {index_m: {normal: [1, -1]}}}', 'standard deviation'),
        ('grid: {index_m: [0.1]}\ngrid: {}', 'grid'),
        ('[]', 'is not a sweep'),
    ],
)
def test_a_sweep_file_is_refused_in_a_line(tmp_path, text, words):
    path = tmp_path / 'sweep.yaml'
    path.write_text(text)
    with pytest.raises(BatchError) as refused:
        sweep_file.read_sweep(path)
    assert words in str(refused.value)
    assert str(path) in str(refused.value)
    assert '\n' not in str(refused.value)


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


def test_a_pattern_of_brushes_is_varied_brush_by_brush():
    model = DepositionModel.of_brushes([Brush(number=k, planar=PlanarPattern()) for k in (1, 4)])
    file = sweep_file.SweepFile.model_validate({'grid': {'brush_4.K1_cm3_per_s': [2.5]}})
    (values,) = sweep_file.variations(file, [model])
    first, other = sweep_file.varied_model(model, values).patterns
    assert (first, other.K1_cm3_per_s) == (PlanarPattern(), 2.5)
    with pytest.raises(BatchError, match=r'vary brush_1\.K2 or brush_4\.K2'):
        sweep_file.varied_model(model, {'planar.K2': 0.2})
    with pytest.raises(BatchError, match="no effect 'brush_4' is in"):
        sweep_file.variations(file)


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
