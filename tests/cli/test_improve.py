"""`paint improve` and `paint plan --optimise` as a user runs them."""

import json

import numpy as np
import pytest
import trimesh
from PIL import Image

from booth import SAMPLES
from cli.command import assert_refused, paint

DOOR, BAG = SAMPLES / 'door.stl', SAMPLES / 'door_horizontal'
COARSE = ('--max-edge-length-m', 0.06)
GIVEN = ('--mesh', DOOR, '--trajectory', BAG, '--state-topic', '/atomizer/state', *COARSE)


@pytest.fixture(scope='module')
def improved(tmp_path_factory):
    """The recorded door improved, with what was printed."""
    folder = tmp_path_factory.mktemp('improved') / 'out'
    done = paint('improve', *GIVEN, '--json', '-o', folder)
    assert done.returncode == 0, done.stderr
    return folder, json.loads(done.stdout)


@pytest.mark.slow
def test_files_and_figures(improved):
    folder, figures = improved
    assert figures['sigma_n']['after'] < 0.8 * figures['sigma_n']['before']
    assert figures['mean_um']['after'] == pytest.approx(figures['mean_um']['before'], rel=0.01)
    assert figures['program_difference'] < 2e-3
    assert [one['number'] for one in figures['passes']] == [1, 2, 3]
    assert 'm/s on average' in figures['passes'][0]['sentence']
    assert {'mesh', 'trajectory'} <= {file['what'] for file in figures['provenance']['files']}
    for name in ('trajectory', 'passes.csv', 'passes.mod', 'model.yaml', 'film.ply'):
        assert (folder / name).exists()
    with Image.open(folder / 'improvement.png') as image:
        assert image.width > 1000


@pytest.mark.slow
@pytest.mark.parametrize('name', ['trajectory', 'passes.mod', 'passes.csv'])
def test_the_film_is_that_of_the_written_files(improved, name, tmp_path):
    folder, figures = improved
    done = paint('simulate', '--mesh', DOOR, '--trajectory', folder / name, *COARSE, '--json',
                 '-o', tmp_path / 'film')  # fmt: skip
    assert done.returncode == 0, done.stderr
    film = np.genfromtxt(tmp_path / 'film/film.csv', delimiter=',', names=True)['thickness_um']
    expected = np.genfromtxt(folder / 'film.csv', delimiter=',', names=True)['thickness_um']
    exact = 1e-5 if name == 'trajectory' else figures['program_difference'] + 1e-4
    assert np.abs(film - expected).max() < exact * expected.max()
    assert json.loads(done.stdout)['model_file'].endswith('model.yaml')


@pytest.mark.slow
def test_a_robot_program_is_improved_in_the_robots_frame(improved, tmp_path):
    """What was improved has hardly anything left; a module in, a module out, in one frame."""
    folder, figures = improved
    pose = (1.8, -0.3, 0.7, 0.0, 0.0, 0.6, 0.8)
    words = ('--mesh', DOOR, *COARSE, '--paint-weight', 0)
    done = paint(
        'improve', *words, '--trajectory', folder / 'passes.mod', '--json', '-o', tmp_path / 'a'
    )
    assert done.returncode == 0, done.stderr
    again = json.loads(done.stdout)
    assert again['sigma_n']['before'] == pytest.approx(figures['sigma_n']['after'], rel=0.01)
    assert again['sigma_n']['after'] > 0.85 * again['sigma_n']['before']
    done = paint('plan', '--mesh', DOOR, *COARSE, '--speed', 0.3, '--part-pose', *pose,
                 '-o', tmp_path / 'robot')  # fmt: skip
    assert done.returncode == 0, done.stderr
    done = paint('improve', *words, '--trajectory', tmp_path / 'robot/passes.mod',
                 '--part-pose', *pose, '-o', tmp_path / 'b')  # fmt: skip
    assert done.returncode == 0, done.stderr
    text = (tmp_path / 'b/passes.mod').read_text()
    assert 'PERS wobjdata wobjPart:=[FALSE,TRUE,"",[[1800.000,-300.000,700.000]' in text


@pytest.mark.parametrize(
    ('more', 'words'),
    [
        (('--speed-min', 0.5, '--speed-max', 0.2), ('speed_min_m_per_s is 0.5', 'swap')),
        (('--flow', 0, 1), ('--flow', '0.0')),
        (('--acceleration', 'fast'), ('fast',)),
        (('--gun-signal', 'doGun'), ('--gun-signal is for RAPID modules',)),
    ],
)
def test_refusals(more, words, tmp_path):
    assert_refused(paint('improve', *GIVEN, *more, '-o', tmp_path / 'out'), *words)


@pytest.fixture(scope='module')
def fender(tmp_path_factory):
    """A curved sheet of 0.6 x 0.7 m, narrower than the spray of two passes."""
    x, z = np.meshgrid(np.linspace(-0.3, 0.3, 13), np.linspace(-0.35, 0.35, 15))
    vertices = np.stack([x, 0.5 * x**2 + 0.35 * z**2, z], axis=2).reshape(-1, 3)
    index = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (index[i : i - 1 or None, j : j - 1 or None] for i, j in
                  ((0, 0), (0, 1), (1, 1), (1, 0)))  # fmt: skip
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3)
    path = tmp_path_factory.mktemp('fender') / 'fender.stl'
    trimesh.Trimesh(vertices, faces).export(path)
    return path


@pytest.mark.slow
def test_optimised_plans_waste_less_for_the_same_film(fender, tmp_path):
    options = ('--target-um', 20, '--optimise', '--max-edge-length-m', 0.06, '--json')
    done = paint('plan', '--mesh', fender, *options, '-o', tmp_path)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    plain, film = told['plain'], told['film']
    assert told['passes'] <= plain['passes']
    assert film['emitted_volume_cm3'] < 0.92 * plain['paint_cm3']
    assert film['capture_fraction'] > 1.08 * plain['capture_fraction']
    assert film['mean_um'] == pytest.approx(20.0, rel=0.01)
    assert told['sigma_n'] < 0.06
