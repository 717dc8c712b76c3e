"""`paint improve` and `paint plan --optimise` as a user runs them."""

import json

import numpy as np
import pytest
from PIL import Image

import paint_deposition as pd
from booth import SAMPLES
from cli.command import assert_refused, figures_of, film_in, paint, ran, sheet

DOOR, BAG = SAMPLES / 'door.stl', SAMPLES / 'door_horizontal'
COARSE = ('--max-edge-length-m', 0.06)
GIVEN = ('--mesh', DOOR, '--trajectory', BAG, '--state-topic', '/atomizer/state', *COARSE)


@pytest.fixture(scope='module')
def improved(tmp_path_factory):
    """The recorded door improved, with what was printed."""
    folder = tmp_path_factory.mktemp('improved') / 'out'
    done = ran('improve', *GIVEN, '--json', '-o', folder)
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
def test_the_film_is_that_of_the_written_files(improved):
    """The bag to the last digits, module and table within what the command says of them."""
    folder, figures = improved
    surface = pd.read_mesh(DOOR, max_edge_length_m=COARSE[1])
    model = pd.read_model(folder / 'model.yaml')
    expected = film_in(folder)
    within = figures['program_difference'] + 1e-4
    for name, share in (('trajectory', 1e-5), ('passes.mod', within), ('passes.csv', within)):
        film = pd.simulate(surface, pd.read_recording(folder / name), model).film_um
        assert np.abs(film - expected).max() < share * expected.max(), name


@pytest.mark.parametrize(
    ('more', 'words'),
    [
        (('--speed-min', 0.5, '--speed-max', 0.2), ('--speed-min is 0.5, above --speed-max',)),
        (('--flow', 0, 1), ('--flow', '0.0')),
        (('--acceleration', 'fast'), ('fast',)),
        (('--gun-signal', 'doGun'), ('--gun-signal is for RAPID modules',)),
    ],
)
def test_refusals(more, words, tmp_path):
    assert_refused(paint('improve', *GIVEN, *more, '-o', tmp_path / 'out'), *words)


@pytest.mark.slow
def test_optimised_plans_waste_less_for_the_same_film(tmp_path):
    """A curved sheet of 0.6 x 0.7 m, narrower than the spray of two passes."""
    x, z = np.meshgrid(np.linspace(-0.3, 0.3, 13), np.linspace(-0.35, 0.35, 15), indexing='ij')
    fender = sheet(x, 0.5 * x**2 + 0.35 * z**2, z, tmp_path / 'fender.stl')
    options = ('--target-um', 20, '--optimise', '--max-edge-length-m', 0.06, '--json')
    told = figures_of('plan', '--mesh', fender, *options, '-o', tmp_path / 'out')
    plain, film = told['plain'], told['film']
    assert told['passes'] <= plain['passes']
    assert film['emitted_volume_cm3'] < 0.92 * plain['paint_cm3']
    assert film['capture_fraction'] > 1.08 * plain['capture_fraction']
    assert film['mean_um'] == pytest.approx(20.0, rel=0.01)
    assert told['sigma_n'] < 0.06
