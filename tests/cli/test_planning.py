"""`paint calibrate`, `paint recommend` and `paint plan` as a user runs them."""

import json

import numpy as np
import pytest
import trimesh
from PIL import Image

import paint_deposition as pd
from booth import SAMPLES
from cli.command import assert_refused, paint, ran
from folded_parts import hood
from paint_deposition.cli.results import MARKER
from paint_deposition.files.rapid.program import read_program
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.planning.recommendation import recommend
from paint_deposition.planning.requests import IndexRequest

STUDY = SAMPLES / 'panel_study'
MODEL = pd.DepositionModel(planar=PlanarPattern(K3=0.1))


@pytest.fixture(scope='module')
def model_file(tmp_path_factory):
    path = tmp_path_factory.mktemp('model') / 'model.yaml'
    pd.write_model(path, MODEL)
    return path


@pytest.fixture(scope='module')
def calibrated(tmp_path_factory):
    folder = tmp_path_factory.mktemp('calibrated')
    return paint('calibrate', STUDY / 'campaign.yaml', '-o', folder), folder


def is_picture(path) -> bool:
    with Image.open(path) as image:
        return image.width > 600 and len(np.unique(np.asarray(image.convert('L')))) > 20


def test_every_option_of_a_recommendation_which_lands_here_without_a_folder(model_file, tmp_path):
    options = (
        '--model', model_file, '--target-um', 20, '--index-min', 0.4, '--index-max', 0.7,
        '--tolerance', 0.2, '--width', 1.2, '--length', 2.0, '--one-way', '--standoff', 0.3,
        '--travel-deg', 90, '--gun-turns',
    )  # fmt: skip
    done = ran('recommend', *options, '--json', cwd=tmp_path)
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == [MARKER, 'recommendation.json', 'uniformity.png']
    assert is_picture(tmp_path / 'uniformity.png')
    content = json.loads(done.stdout)
    assert content == json.loads((tmp_path / 'recommendation.json').read_text())
    request = IndexRequest(
        target_um=20.0, index_min_m=0.4, index_max_m=0.7, tolerance=0.2, width_m=1.2,
        length_m=2.0, one_way=True, standoff_m=0.3, travel_rad=np.pi / 2, gun_turns=True,
    )  # fmt: skip
    expected = recommend(MODEL, request)
    assert content.pop('provenance')['models']['model']['planar']
    assert content == json.loads(json.dumps(expected.to_dict()))
    done = paint('recommend', *options, cwd=tmp_path)
    assert expected.sentence in done.stdout


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        ((), 'neither --speed nor --target-um'),
        (('--speed', -1), "'--speed': -1.0 is not in the range"),
        (('--speed', 'nan'), 'nan is not finite'),
        (('--speed', 0.2, '--travel-deg', 'inf'), 'inf is not finite'),
        (('--speed', 0.2, '--tolerance', 1e-6), 'the closest is'),
        (('--speed', 0.2, '--tolerance', 5), 'wanted: Largest sigma_n accepted, 0.05 for 5 %'),
        (('--speed', 0.2, '--model', 'nowhere.yaml'), 'nowhere.yaml: no such file'),
    ],
)
def test_impossible_recommendations_are_refused(arguments, words, tmp_path):
    assert_refused(paint('recommend', *arguments, cwd=tmp_path), words)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_calibration_writes_model_figures_and_pictures(calibrated):
    done, folder = calibrated
    assert done.returncode == 0, done.stderr
    model = pd.read_model(folder / 'model.yaml')
    assert model.planar.K1_cm3_per_s == pytest.approx(0.653, rel=0.02)
    content = json.loads((folder / 'calibration.json').read_text())
    assert content['experiments'][0]['residual_sd_um'] < 0.75
    # The panel was painted by eq. (1).
    assert content['footprint']['deviation_of_peak'] < 0.1
    assert 'differs from two Gaussians' not in done.stdout
    assert (content['converged'], content['readings']) == (True, 90)
    assert content['parameters']['r_m']['low'] < 0.231 < content['parameters']['r_m']['high']
    for name in ('collapse.png', 'profiles.png', 'agreement.png'):
        assert is_picture(folder / name)
    assert 'panel_577: 70 points' in done.stdout
    assert 'warning: phi_rad is not determined' in done.stderr


@pytest.mark.slow
def test_plan_writes_bag_table_program_and_film(model_file, tmp_path):
    door = SAMPLES / 'door.stl'
    arguments = ('--mesh', door, '--model', model_file, '--target-um', 20, '--speed-max', 0.1)
    done = ran('plan', *arguments, '-o', tmp_path / 'plan', '--json', '--paint-moves')
    content = json.loads(done.stdout)
    assert content == json.loads((tmp_path / 'plan' / 'plan.json').read_text())
    (warning,) = content['warnings']
    assert warning.endswith('m/s are allowed (--speed-min, --speed-max)')
    assert f'warning: {warning}\n' in done.stderr
    assert content['film']['mean_um'] == pytest.approx(20.0, rel=5e-3)
    assert content['sigma_n'] < content['plane']['sigma_n_on_part']
    names = {path.name for path in (tmp_path / 'plan').iterdir()}
    assert names == {
        MARKER, 'film.csv', 'film.ply', 'film.png', 'model.yaml', 'passes.csv', 'passes.mod',
        'plan.json', 'stats.json', 'trajectory',
    }  # fmt: skip
    program = read_program(tmp_path / 'plan' / 'passes.mod')
    assert {'paintl', 'movel'} <= {move.instruction for move in program.moves}
    assert len(pd.read_recording(tmp_path / 'plan' / 'trajectory')) > 1000
    assert is_picture(tmp_path / 'plan' / 'film.png')


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (('--mesh', 'nowhere.stl', '--speed', 0.3), 'nowhere.stl: no such mesh file'),
        (('--mesh', SAMPLES / 'door.stl'), 'neither --speed nor --target-um'),
        (('--mesh', SAMPLES / 'door.stl', '--speed', 0.3, '--index', -1), "'--index'"),
        (('--mesh', 'door.stl', '--speed', 0.3, '--index', 577), '<=10.0, in metres'),
        (('--mesh', 'door.stl', '--speed', 0.3, '--standoff', 250), '<=10.0, in metres'),
        (('--mesh', 'door.stl', '--speed', 0.3, '--outward', 0, 'nan', 0), 'nan is not finite'),
        (('--mesh', 'door.stl', '--speed', 0.3, '--outward', 0, 0, 0), 'give a direction'),
        (('--mesh', 'door.stl', '--speed', 0.3, '--down', 'nan', 0, 0), 'nan is not finite'),
    ],
)
def test_impossible_plans_are_refused(arguments, words, tmp_path):
    assert_refused(paint('plan', *arguments, '-o', tmp_path / 'plan'), words)
    assert not (tmp_path / 'plan').exists()


@pytest.fixture
def folded(tmp_path):
    surface = hood(0.06)
    path = tmp_path / 'hood.ply'
    trimesh.Trimesh(surface.vertices_m, surface.faces, process=False).export(path)
    return path


@pytest.mark.slow
@pytest.mark.usefixtures('undrawn')
def test_speeds_along_the_passes_even_the_seams_of_two_faces_further(folded, tmp_path):
    options = ('--faces', 'auto', '--target-um', 20, '--max-edge-length-m', 0.06, '--json')
    plans = []
    for more in (('--keep-off-m', 0.4), ('--optimise',)):
        done = ran('plan', '--mesh', folded, *options, *more, '-o', tmp_path / 'plan')
        plans.append(json.loads(done.stdout))
        near = 'warning: the part is too near before the gun at (' in done.stderr
        assert near == ('--keep-off-m' in more)
    names = {path.name for path in (tmp_path / 'plan').iterdir()}
    assert {'trajectory', 'passes.csv', 'passes.mod', 'passes.png', 'film.png'} <= names
    assert len(plans[0]['faces']) == 2
    assert plans[0]['sigma_n'] < plans[0]['sigma_n_unblended']
    assert plans[1]['sigma_n'] < 0.95 * plans[0]['sigma_n']
    assert plans[1]['film']['mean_um'] == pytest.approx(20.0, rel=0.01)
    assert not plans[1]['contacts']


def test_an_angle_that_is_none_is_refused(folded, tmp_path):
    options = ('--faces', 'auto', '--target-um', 20, '--face-angle-deg', 90)
    assert_refused(paint('plan', '--mesh', folded, *options, '-o', tmp_path / 'plan'), '90')
