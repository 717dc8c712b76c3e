"""A plan's own files, simulated without --model: the film is the planned one."""

import shutil

import numpy as np
import pytest

import paint_deposition as pd
from booth import SAMPLES
from cli.command import COARSE, ran, rows_of, told_in
from paint_deposition.files.provenance import model_digest, origin, planned_model
from paint_deposition.files.recordings.bag_files import open_bag
from paint_deposition.motion.programmed import PROGRAMMED

PANEL = SAMPLES / 'panel.stl'
PART_POSE = (1.8, -0.3, 0.7, 0.0, 0.0, 0.6, 0.8)
MODEL = """planar: {K1_cm3_per_s: 0.6, r_m: 0.12, sigma1_m: 0.06, sigma2_m: 0.08}
effects:
  - {id: tcp_standoff, offset_z_m: 0.01}
"""


@pytest.fixture(scope='module')
def model_file(tmp_path_factory):
    path = tmp_path_factory.mktemp('models') / 'narrow.yaml'
    path.write_text(MODEL)
    return path


@pytest.fixture(scope='module')
def plan(model_file):
    """A plan for a model that is not the default, in the part's frame."""
    return planned(model_file.with_name('job'), model_file)


def planned(folder, model_file, *more):
    given = ('--mesh', PANEL, '--model', model_file, '--target-um', 20, '--index', 0.15)
    first = ran('plan', *given, *COARSE, *more, '-o', folder).stdout.splitlines()[0]
    assert first.startswith(f'model: {model_file} (')
    assert first.endswith('effects: tcp_standoff')
    return folder


def simulated(motion, out, *more):
    done = ran('simulate', '--mesh', PANEL, '--trajectory', motion, *COARSE, *more, '-o', out)
    return told_in(out / 'stats.json'), done


@pytest.mark.slow
@pytest.mark.parametrize('motion', ['trajectory', 'passes.mod', 'passes.csv'])
def test_the_film_is_the_planned_one(motion, plan, tmp_path):
    """The bag to the last digits; module and table leave out acceleration, outside the part."""
    expected, exact = told_in(plan / 'plan.json')['film'], 1e-5 if motion == 'trajectory' else 0.02
    film, done = simulated(plan / motion, tmp_path / 'out')
    first = done.stdout.splitlines()[0]
    model = (plan / motion if motion == 'trajectory' else plan) / 'model.yaml'
    assert first.startswith(f'model: that of the plan, {model} (')
    assert film['model_file'] == str(model)
    for name in ('mean_um', 'coverage'):
        assert film[name] == pytest.approx(expected[name], rel=exact)
    if motion != 'trajectory':
        assert f'note: {PROGRAMMED}' in done.stderr.splitlines()
    assert 'warning' not in done.stderr


@pytest.mark.slow
def test_a_plan_in_the_robots_frame_lays_the_same_film(plan, model_file, tmp_path):
    """The bag tells the pose of the part itself; the module has it in its work object."""
    placed = planned(tmp_path / 'job', model_file, '--part-pose', *PART_POSE)
    expected = pd.read_recording(plan / 'trajectory')
    told = pd.read_recording(placed / 'trajectory')
    given = pd.read_recording(placed / 'trajectory', part_pose=PART_POSE)
    assert np.allclose(told.positions_m, expected.positions_m, atol=1e-5)
    assert np.allclose(given.positions_m, expected.positions_m, atol=1e-5)
    brought = "static transforms: poses brought from 'base_link' to 'part'"
    assert any(brought in note for note in told.notes)
    first, *_ = rows_of(placed / 'passes.csv')
    with open_bag(placed / 'trajectory') as bag:
        _, _, pose = next(bag.decoded(['/atomizer/pose']))
    assert pose.header.frame_id == 'base_link'
    place = pose.pose.position
    row = [float(first[name]) for name in ('x_m', 'y_m', 'z_m')]
    assert np.allclose(row, [place.x, place.y, place.z], atol=1e-5)
    module, same = (
        pd.read_recording(folder / 'passes.mod', part_pose=pose)
        for folder, pose in ((placed, PART_POSE), (plan, None))
    )
    # Rounded to micrometres, a move may take a sample more.
    for of in (np.min, np.max):
        assert np.allclose(of(module.positions_m, axis=0), of(same.positions_m, axis=0), atol=1e-5)
    assert np.allclose(module.positions_m[[0, -1]], same.positions_m[[0, -1]], atol=1e-5)


@pytest.mark.slow
def test_a_model_that_is_given_wins_and_is_named(plan, tmp_path):
    (tmp_path / 'other.yaml').write_text('name: bell 7\neffects: []\n')
    bag = plan / 'trajectory'
    _, done = simulated(bag, tmp_path / 'other', '--model', tmp_path / 'other.yaml')
    assert done.stdout.startswith(f"model: {tmp_path / 'other.yaml'} 'bell 7' (")
    assert f'note: {bag} was planned with another model' in done.stderr
    # A module away from its model is warned of.
    shutil.copy(plan / 'passes.mod', tmp_path)
    _, done = simulated(tmp_path / 'passes.mod', tmp_path / 'out')
    warning = next(line for line in done.stderr.splitlines() if line.startswith('warning: '))
    assert 'was planned with a model' in warning
    assert '--model' in warning
    # Another model of that name is not taken for it.
    (tmp_path / 'model.yaml').write_text('effects: []\n')
    _, done = simulated(tmp_path / 'passes.mod', tmp_path / 'out')
    assert warning in done.stderr.splitlines()


def test_the_digest_is_that_of_the_values(model_file, tmp_path):
    model = pd.read_model(model_file)
    expected = model_digest(model)
    assert origin(model)['models']['model']['sha256'] == expected

    def digest(text: str) -> str:
        (tmp_path / 'again.yaml').write_text(text)
        return model_digest(pd.read_model(tmp_path / 'again.yaml'))

    assert digest(f'# a comment\n{MODEL}') == expected
    assert digest(MODEL.replace('0.12', '0.120')) == expected
    assert digest(MODEL.replace('0.12', '0.121')) != expected


def test_recordings_and_plain_tables_are_no_plans(tmp_path):
    (tmp_path / 'run.csv').write_text('t,x\n')
    assert planned_model(tmp_path / 'run.csv') is None
    assert planned_model(SAMPLES / 'panel_577') is None
    assert planned_model(tmp_path / 'nowhere.mod') is None
