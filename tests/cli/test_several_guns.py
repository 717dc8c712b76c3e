"""Several guns on one part, offline: one film, each gun's share, and one clear line if not."""

import numpy as np
import pytest
import yaml

import paint_deposition as pd
from booth import LOOKING_ALONG_Y, SAMPLES
from cli.command import assert_refused, figures_of, paint
from files.recorded import Messages, pose_entries, write_bag
from paint_deposition.effects.library.flow_drift import FlowDrift
from paint_deposition.effects.library.sag import Sag
from paint_deposition.errors import ModelError
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.inference.fitting.forward import Forward
from paint_deposition.model.eq1_pattern import Brush, PlanarPattern
from scenes import straight_pass

PANEL = SAMPLES / 'panel.stl'
TIMES_S = np.arange(0.0, 3.0, 0.02)
UPPER = straight_pass(TIMES_S, (-0.5, -0.25, 0.15), (0.5, -0.25, 0.15), LOOKING_ALONG_Y)
LOWER = straight_pass(TIMES_S + 1.0, (0.5, -0.25, -0.1), (-0.5, -0.25, -0.1), LOOKING_ALONG_Y)
THIN = pd.DepositionModel(planar=PlanarPattern(K1_cm3_per_s=0.7))


@pytest.fixture(scope='module')
def surface():
    return pd.read_mesh(PANEL, max_edge_length_m=0.05)


@pytest.fixture(scope='module')
def bags(tmp_path_factory):
    """A bag for each gun, and one with both as the cell's recorder names their topics."""
    folder = tmp_path_factory.mktemp('bags')
    messages = Messages()
    # The second gun opens in the middle of its pass; the first one's state was not recorded.
    half_ns = int(LOWER.stamps_ns[len(LOWER) // 2])
    states = [('/robot_2/atomizer/state', half_ns, messages.state(half_ns, True, 1.0))]
    both = write_bag(
        folder / 'both',
        sorted(
            [
                *pose_entries(UPPER, '/robot_1/atomizer/pose'),
                *pose_entries(LOWER, '/robot_2/atomizer/pose'),
                *states,
            ],
            key=lambda entry: entry[1],
        ),
    )
    return {
        'both': both,
        'upper': write_pose_bag(folder / 'upper', UPPER),
        'lower': write_pose_bag(folder / 'lower', LOWER),
        'thin': _model(folder / 'thin.yaml', THIN),
        'sagging': _model(folder / 'sagging.yaml', THIN.with_effect(Sag.typical())),
    }


def _model(path, model):
    pd.write_model(path, model)
    return path


def test_the_film_is_the_sum_of_the_guns(surface):
    models = [pd.DepositionModel(), THIN]
    alone = [
        pd.simulate(surface, motion, model)
        for motion, model in zip((UPPER, LOWER), models, strict=True)
    ]
    both = pd.simulate(surface, [UPPER, LOWER], models)
    assert np.array_equal(both.film_um, alone[0].film_um + alone[1].film_um)
    volumes = [gun.painted_volume_cm3 for gun in both.guns]
    assert volumes == pytest.approx([film.statistics.painted_volume_cm3 for film in alone])
    assert both.statistics.painted_volume_cm3 == pytest.approx(sum(volumes))
    assert both.statistics.emitted_volume_cm3 == pytest.approx(
        sum(film.statistics.emitted_volume_cm3 for film in alone)
    )
    assert [gun.name for gun in both.guns] == ['gun 1', 'gun 2']


def test_one_bag_with_both_guns(bags, tmp_path):
    guns = '--atomizer', 'robot_1', '--atomizer', '/robot_2'
    figures = figures_of(
        'simulate', '--mesh', PANEL, '--trajectory', bags['both'], *guns, '--json', '-o', tmp_path,
        '--max-edge-length-m', 0.05,
    )  # fmt: skip
    first, second = figures['atomizers']
    assert (first['name'], second['name']) == ('robot_1', 'robot_2')
    # The one without a state sprays all the way, the other from the middle of its pass on.
    assert second['spraying_time_s'] == pytest.approx(0.5 * first['spraying_time_s'], rel=0.02)
    laid_cm3 = first['painted_volume_cm3'] + second['painted_volume_cm3']
    assert laid_cm3 == pytest.approx(figures['painted_volume_cm3'])
    assert set(figures['provenance']['models']) == {'robot_1', 'robot_2'}


@pytest.mark.parametrize(
    ('words', 'message'),
    [
        (['--model', 'thin', '--model', 'thin', '--model', 'thin'], '--model is given 3 times'),
        (['--model', 'thin', '--model', 'sagging'], r'differ in what acts on the finished film'),
        (['--atomizer', 'a', '--atomizer', 'b', '--atomizer', 'c'], '2 files for 3 atomizers'),
        (['--atomizer', 'a', '--atomizer', 'b', '--pose-topic', '/p'], 'leave out --atomizer, or'),
    ],
)
def test_what_does_not_go_together_is_refused(bags, tmp_path, words, message):
    words = [bags.get(word, word) for word in words]
    done = paint(
        'simulate', '--mesh', PANEL, '--trajectory', bags['upper'], '--trajectory', bags['lower'],
        *words, '-o', tmp_path / 'out', '--max-edge-length-m', 0.05,
    )  # fmt: skip
    assert_refused(done, message)


def write_readings(path, surface, film_um):
    """The film at some vertices in the middle of the panel, to the last bit."""
    inside = np.flatnonzero(np.abs(surface.vertices_m[:, [0, 2]]).max(axis=1) < 0.2)[::5]
    rows = np.column_stack([surface.vertices_m, film_um])[inside]
    table = '\n'.join(','.join(map(repr, row.tolist())) for row in rows)
    path.write_text(f'x_m,y_m,z_m,thickness_um\n{table}\n')


def test_a_campaign_whose_parts_were_painted_by_two_guns(bags, surface, tmp_path):
    """A law that counts a gun's own passes counts them so in a campaign, too."""
    model = pd.DepositionModel().with_effect(FlowDrift(drift_per_pass=0.2))
    films = [pd.simulate(surface, motion, model).film_um for motion in (UPPER, LOWER)]
    film = pd.simulate(surface, [UPPER, LOWER], model)
    assert np.array_equal(film.film_um, films[0] + films[1])
    write_readings(tmp_path / 'film.csv', surface, film.film_um)
    guns = [{'pose_topic': '/robot_1/atomizer/pose'}, {'trajectory': str(bags['lower'])}]
    entry = {
        'name': 'panel', 'mesh': str(PANEL), 'trajectory': str(bags['both']), 'guns': guns,
        'measurements': 'film.csv',
    }  # fmt: skip
    path = tmp_path / 'campaign.yaml'
    path.write_text(yaml.safe_dump({'experiments': [entry]}))
    campaign = pd.read_campaign(path)
    assert campaign.experiments[0].path.spray_pass.max() == 1
    predicted = Forward(campaign).predict_um(model)
    assert predicted == pytest.approx(campaign.readings.thickness_um, rel=1e-5)
    assert campaign.experiments[0].files['trajectory 2'] == str(bags['lower'])


@pytest.mark.slow
def test_guns_of_different_patterns_share_a_campaign_as_brushes(bags, surface, tmp_path):
    bell = pd.DepositionModel()
    film = pd.simulate(surface, [UPPER, LOWER], [bell, THIN]).film_um
    write_readings(tmp_path / 'film.csv', surface, film)
    guns = [{'trajectory': str(bags['upper'])}, {'trajectory': str(bags['lower']), 'brush': 2}]
    entry = {'mesh': str(PANEL), 'measurements': 'film.csv', 'guns': guns, 'brush': 1}
    path = tmp_path / 'campaign.yaml'
    path.write_text(yaml.safe_dump({'experiments': [entry]}))
    both = pd.DepositionModel.of_brushes(
        Brush(number=number, planar=model.planar) for number, model in ((1, bell), (2, THIN))
    )
    assert pd.compare(pd.read_campaign(path), both).points.rmse_um < 1e-4
    # One pattern for both guns is not enough.
    with pytest.raises(ModelError, match='brushes 1, 2 are used and the model has the pattern of'):
        pd.compare(pd.read_campaign(path), bell)
