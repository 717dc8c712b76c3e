"""Several guns or brushes on one part, offline: the film, each share, one line if not."""

import json

import numpy as np
import pytest
import yaml

import paint_deposition as pd
from booth import LOOKING_ALONG_Y, SAMPLES
from brushes import switched
from cli.command import BRUSHES, assert_refused, figures_of, level_pass, paint, ran
from files.recorded import Messages, pose_entries, write_bag
from paint_deposition.effects.library.flow_drift import FlowDrift
from paint_deposition.errors import ModelError
from paint_deposition.files.model_file import read_model
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.inference.fitting.forward import Forward
from paint_deposition.model.eq1_pattern import Brush, PlanarPattern
from scenes import stamps_ns, straight_pass

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
    entries = [
        *pose_entries(UPPER, '/robot_1/atomizer/pose'),
        *pose_entries(LOWER, '/robot_2/atomizer/pose'),
        ('/robot_2/atomizer/state', half_ns, messages.state(half_ns, True, 1.0)),
    ]
    return {
        'both': write_bag(folder / 'both', sorted(entries, key=lambda entry: entry[1])),
        'upper': write_pose_bag(folder / 'upper', UPPER),
        'lower': write_pose_bag(folder / 'lower', LOWER),
    }


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
    sprayed_cm3 = first['emitted_volume_cm3'] + second['emitted_volume_cm3']
    assert sprayed_cm3 == pytest.approx(figures['emitted_volume_cm3'])
    assert set(figures['provenance']['models']) == {'robot_1', 'robot_2'}


def campaign(folder, surface, film_um, **entry):
    """A campaign with the film at some vertices in the middle of the panel, to the last bit."""
    inside = np.flatnonzero(np.abs(surface.vertices_m[:, [0, 2]]).max(axis=1) < 0.2)[::5]
    rows = np.column_stack([surface.vertices_m, film_um])[inside]
    table = '\n'.join(','.join(map(repr, row.tolist())) for row in rows)
    (folder / 'film.csv').write_text(f'x_m,y_m,z_m,thickness_um\n{table}\n')
    entry |= {'name': 'panel', 'mesh': str(PANEL), 'measurements': 'film.csv'}
    (folder / 'campaign.yaml').write_text(yaml.safe_dump({'experiments': [entry]}))
    return pd.read_campaign(folder / 'campaign.yaml')


def test_a_campaign_whose_parts_were_painted_by_two_guns(bags, surface, tmp_path):
    """A law that counts a gun's own passes counts them so in a campaign, too."""
    model = pd.DepositionModel().with_effect(FlowDrift(drift_per_pass=0.2))
    films = [pd.simulate(surface, motion, model).film_um for motion in (UPPER, LOWER)]
    film = pd.simulate(surface, [UPPER, LOWER], model)
    assert np.array_equal(film.film_um, films[0] + films[1])
    guns = [{'pose_topic': '/robot_1/atomizer/pose'}, {'trajectory': str(bags['lower'])}]
    both = {'trajectory': str(bags['both']), 'guns': guns}
    read = campaign(tmp_path, surface, film.film_um, **both)
    assert read.experiments[0].path.spray_pass.max() == 1
    assert Forward(read).predict_um(model) == pytest.approx(read.readings.thickness_um, rel=1e-5)
    assert read.experiments[0].files['trajectory 2'] == str(bags['lower'])


@pytest.mark.slow
def test_guns_of_different_patterns_share_a_campaign_as_brushes(bags, surface, tmp_path):
    bell = pd.DepositionModel()
    film = pd.simulate(surface, [UPPER, LOWER], [bell, THIN]).film_um
    guns = [{'trajectory': str(bags['upper'])}, {'trajectory': str(bags['lower']), 'brush': 2}]
    read = campaign(tmp_path, surface, film, guns=guns, brush=1)
    both = pd.DepositionModel.of_brushes(
        Brush(number=number, planar=model.planar) for number, model in ((1, bell), (2, THIN))
    )
    assert pd.compare(read, both).points.rmse_um < 1e-4
    # One pattern for both guns is not enough.
    with pytest.raises(ModelError, match='brushes 1, 2 are used and the model has the pattern of'):
        pd.compare(read, bell)


@pytest.fixture
def model(tmp_path):
    path = tmp_path / 'model.yaml'
    path.write_text(BRUSHES)
    return path


def bag(tmp_path, *changes):
    """A pass before the panel along which these (time [s], flow, brush) are set."""
    stamps = stamps_ns([time_s for time_s, *_ in changes])
    motion = level_pass(**switched(stamps, *(gun for _, *gun in changes)))
    return write_pose_bag(tmp_path / 'run', motion)


@pytest.mark.slow
def test_a_recording_of_two_brushes_tells_its_paint(model, panel, tmp_path):
    """A state of a brush that the model lacks is left out, as by the nodes."""
    run = bag(tmp_path, (0.5, 1.0, 1), (0.8, 1.0, 9), (1.5, 1.0, 2), (2.5, 0.0, 0))
    given = (
        'simulate', '--mesh', panel, '--trajectory', run, '--model', model, '--state-topic',
        '/atomizer/state', '--max-edge-length-m', 0.05, '--json', '-o', tmp_path / 'film',
    )  # fmt: skip
    refusal = 'brush 9 is not in the model; its brushes: 1, 2, 3'
    assert_refused(paint(*given, '--strict'), refusal)
    done = ran(*given)
    assert f'1 states left out: {refusal}' in done.stderr
    told = json.loads(done.stdout)
    assert told['emitted_volume_cm3'] == pytest.approx(0.7 + 1.4, rel=1e-6)
    used = told['paint']
    assert used['wet_cm3'] == pytest.approx((200 + 400) / 60, rel=1e-6)
    assert used['transfer_efficiency'] == pytest.approx(told['painted_volume_cm3'] / 4.0)
    assert used['mean_wet_film_um'] == pytest.approx(told['mean_um'] / 0.4, rel=1e-9)
    assert used['spraying_time_s_by_brush'] == pytest.approx({'1': 1.0, '2': 1.0})
    assert told['provenance']['models']['model']['brushes'][1]['number'] == 2


@pytest.mark.slow
def test_a_plan_sprays_with_the_brush_that_is_chosen(model, panel, tmp_path):
    given = ('--mesh', panel, '--model', model, '--speed', 0.4, '--max-edge-length-m', 0.05)
    planned = figures_of('plan', *given, '--brush', 3, '--json', '-o', tmp_path / 'plan')
    assert set(planned['paint']['spraying_time_s_by_brush']) == {'3'}
    (written,) = read_model(tmp_path / 'plan/model.yaml').brushes
    assert written == read_model(model).brushes[2]
    films = []
    for motion, *chosen in (('trajectory',), ('passes.mod', '--model', model)):
        done = ran(
            'simulate', '--mesh', panel, '--trajectory', tmp_path / 'plan' / motion, '--json',
            '--max-edge-length-m', 0.05, *chosen, '-o', tmp_path / 'film',
        )  # fmt: skip
        assert 'planned with another model' not in done.stderr
        films.append(json.loads(done.stdout)['mean_um'])
    assert films[1] == pytest.approx(films[0], rel=2e-3)
