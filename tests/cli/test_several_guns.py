"""Several guns, brushes or coats on one part, offline: the film, each share, one line if not."""

import json

import numpy as np
import pytest
import trimesh
import yaml

import paint_deposition as pd
from booth import LOOKING_ALONG_Y, SAMPLES
from brushes import NARROW, WIDE, switched
from cli.command import (
    BRUSHES,
    assert_refused,
    figures_of,
    level_pass,
    paint,
    ran,
    rows_of,
    told_in,
)
from files.recorded import Messages, pose_entries, write_bag
from paint_deposition.effects.library.flow_drift import FlowDrift
from paint_deposition.effects.library.sag import Sag
from paint_deposition.files.model_file import read_model
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.film.layout import term_weights
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
    brushes = [Brush(number=1, planar=bell.planar), Brush(number=2, planar=THIN.planar)]
    both = pd.DepositionModel(brushes=brushes)
    assert pd.compare(read, both).points.rmse_um < 1e-4


@pytest.fixture
def model(tmp_path):
    path = tmp_path / 'model.yaml'
    path.write_text(BRUSHES)
    return path


@pytest.mark.slow
def test_a_recording_of_two_brushes_tells_its_paint(model, panel, tmp_path):
    """A state of a brush that the model lacks is left out, as by the nodes."""
    guns = switched(stamps_ns([0.5, 0.8, 1.5, 2.5]), (1.0, 1), (1.0, 9), (1.0, 2), (0.0, 0))
    run = write_pose_bag(tmp_path / 'run', level_pass(**guns))
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


COATS = {
    'base': straight_pass(TIMES_S, (-0.5, -0.25, 1.1), (0.5, -0.25, 1.1), LOOKING_ALONG_Y),
    'clear': straight_pass(TIMES_S, (0.1, -0.25, 1.4), (0.1, -0.25, 0.6), LOOKING_ALONG_Y),
}
LAYERS = ('base', 'clear', 'base+clear')
# 0.5 and 0.25 of the paint are solids; the flow of the base coat is not known.
TWO_PAINTS = [
    pd.DepositionModel(brushes=[Brush(number=1, planar=planar, solids=solids, **more)])
    for planar, solids, more in ((WIDE, 0.5, {}), (NARROW, 0.25, {'flow_cm3_per_min': 600.0}))
]


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    """A recording of each coat, and a model of the paint of each."""
    folder = tmp_path_factory.mktemp('coats')
    for (name, motion), model in zip(COATS.items(), TWO_PAINTS, strict=True):
        write_pose_bag(folder / name, motion)
        pd.write_model(folder / f'{name}.yaml', model)
    return folder


def write_readings(folder, model, layers, **laid):
    """Readings of these layers at 24 points, each twice, as the model predicts them."""
    surface = pd.read_mesh(PANEL, max_edge_length_m=0.1)
    x, z = np.random.default_rng(3).uniform(-0.25, 0.25, (2, 24))
    places = np.tile(np.column_stack([x, 0 * x, 1.0 + z]), (2 * len(layers), 1))
    names = np.repeat(layers, 48)
    readings = pd.Readings.of(places, np.full(len(places), 20.0), layer=names)
    laid |= {'coats': [*COATS], 'readings': readings}
    film = pd.simulate(surface, [*COATS.values()], model, **laid)
    rows = zip(places.tolist(), film.predicted_um.tolist(), names, strict=True)
    lines = (f'{",".join(map(repr, place))},{um!r},{layer}' for place, um, layer in rows)
    (folder / 'readings.csv').write_text('\n'.join(['x_m,y_m,z_m,thickness_um,layer', *lines]))
    return film.predicted_um


def coated(folder, said=({}, {}), **more):
    """The campaign's file: an experiment in which both coats were painted."""
    listed = [
        {'name': name, 'trajectory': str(folder / name)} | own
        for name, own in zip(COATS, said, strict=True)
    ]
    entry = {'name': 'panel', 'mesh': str(PANEL), 'measurements': 'readings.csv', 'coats': listed}
    path = folder / 'campaign.yaml'
    path.write_text(yaml.safe_dump({'experiments': [entry | more]}))
    return path


def test_each_coat_has_a_column_its_figures_and_its_wet_film(folder, tmp_path):
    models = [word for name in COATS for word in ('--model', folder / f'{name}.yaml')]
    motions = [word for name in COATS for word in ('--trajectory', folder / name, '--coat', name)]
    edge = ('--max-edge-length-m', 0.1)
    done = ran('simulate', '--mesh', PANEL, *motions, *edge, *models, '-o', tmp_path)
    figures = told_in(tmp_path / 'stats.json')
    table = np.genfromtxt(tmp_path / 'film.csv', delimiter=',', names=True)
    assert table.dtype.names == ('x_m', 'y_m', 'z_m', 'thickness_um', 'base_um', 'clear_um')
    mesh = trimesh.load_mesh(tmp_path / 'film.ply', process=False)
    vertices = mesh.metadata['_ply_raw']['vertex']['data']
    wet_um = {}
    for coat, solids in zip(figures['coats'], (0.5, 0.25), strict=True):
        column = f'{coat["name"]}_um'
        assert np.allclose(np.ravel(vertices[column]), table[column], rtol=1e-6)
        assert table[column].max() == pytest.approx(coat['max_um'])
        wet_um[coat['name']] = coat['paint']['mean_wet_film_um']
        assert wet_um[coat['name']] == pytest.approx(coat['mean_um'] / solids)
        assert f'coat {coat["name"]} {coat["mean_um"]:.1f} µm mean' in done.stdout
        assert f'{wet_um[coat["name"]]:.1f} µm mean wet' in done.stdout
    assert np.allclose(table['base_um'] + table['clear_um'], table['thickness_um'], atol=1e-6)
    # The whole film: solids of both over their wet volumes.
    emitted = [coat['emitted_volume_cm3'] for coat in figures['coats']]
    share = sum(emitted) / (emitted[0] / 0.5 + emitted[1] / 0.25)
    assert figures['paint']['mean_wet_film_um'] == pytest.approx(figures['mean_um'] / share)


@pytest.mark.parametrize('wet_by', ['none', 'coat', 'experiment'])
def test_a_campaign_predicts_each_layer_as_simulate_does(folder, wet_by):
    model = pd.DepositionModel().with_effect(Sag(run_m=0.01))
    taken_um = write_readings(folder, model, LAYERS, wet_on_wet=wet_by != 'none')
    said = ({}, {'wet_on_wet': True}) if wet_by == 'coat' else ({}, {})
    read = pd.read_campaign(coated(folder, said, wet_on_wet=wet_by == 'experiment'))
    assert [one.name for one in read.experiments] == [
        f'panel: {x}' for x in (*LAYERS[:2], 'total')
    ]
    predicted_um = Forward(read).predict_um(model)[read.readings.owner]
    assert predicted_um == pytest.approx(taken_um, abs=1e-5)
    weights, _ = term_weights(model.planar)
    weighted_um = Forward(read, model.effects).of_weights(model)(weights)
    assert weighted_um[read.readings.owner] == pytest.approx(taken_um, abs=1e-5)


def test_wet_readings_are_dried_by_the_solids_of_their_coat(folder):
    taken_um = write_readings(folder, pd.DepositionModel(), LAYERS[:2])
    solids = {'solids': 0.5}, {'solids': 0.25}
    dried = pd.read_campaign(coated(folder, solids, wet=True, under_um=3.0)).readings
    expected_um = np.repeat([0.5, 0.25], 48) * taken_um
    assert dried.thickness_um == pytest.approx(expected_um)
    with pytest.raises(pd.PaintError, match="the solids of layer 'base' are not said; give"):
        pd.read_campaign(coated(folder, wet=True))
    write_readings(folder, pd.DepositionModel(), ['total'])
    with pytest.raises(pd.PaintError, match="the solids of layer 'total' differ; give"):
        pd.read_campaign(coated(folder, solids, wet=True))
    # With a known film below: it is part of what was read of all coats.
    below = [pd.read_campaign(coated(folder, under_um=um)).readings for um in (0.0, 3.0)]
    assert below[0].thickness_um - below[1].thickness_um == pytest.approx(np.full(48, 3.0))


@pytest.mark.parametrize(('header', 'layer', 'more', 'message'), [
    ('layer', 'primer', {}, "layer 'primer' has no coat of the part; its coats: base, clear"),
    ('Schicht', 'base', {'coats': [], 'trajectory': 'base'}, "layers 'base', '', and nothing"),
    ('layer', 'base', {'coats': [{'name': 'base'}]}, "coat 'base' has no 'trajectory'"),
    ('layer', 'base', {'coats': [{'name': 'a', 'trajectory': 'base'}] * 2}, "two coats are c"),
])  # fmt: skip
def test_layers_that_no_coat_has_are_refused(folder, header, layer, more, message):
    rows = f'0,0,0,9,{layer}\n0.1,0,0,9,'
    (folder / 'readings.csv').write_text(f'x_m,y_m,z_m,DFT,{header}\n{rows}\n')
    with pytest.raises(pd.PaintError, match=message):
        pd.read_campaign(coated(folder, **more))


def test_a_column_of_wet_film_tells_the_remedy(folder):
    (folder / 'readings.csv').write_text('x_m,y_m,z_m,Nassschichtdicke [µm]\n0,0,0,40\n')
    with pytest.raises(pd.PaintError, match=r'is a wet film: say wet: true, give its solids'):
        pd.read_campaign(coated(folder))
    named = {'columns': {'thickness': 'Nassschichtdicke [µm]'}, 'wet': True, 'solids': 0.5}
    readings = pd.read_campaign(coated(folder, **named)).readings
    assert readings.thickness_um.tolist() == [20.0]


def test_residuals_name_their_layer(folder, tmp_path):
    write_readings(folder, pd.DepositionModel(), ['base', 'total'])
    pd.write_model(tmp_path / 'model.yaml', pd.DepositionModel())
    ran('compare', coated(folder), '--model', tmp_path / 'model.yaml', '-o', tmp_path)
    rows = rows_of(tmp_path / 'residuals.csv')
    assert list(rows[0])[-1] == 'layer'
    for row in rows:
        assert row['experiment'] == f'panel: {row["layer"]}'
    assert {row['layer'] for row in rows} == {'base', 'total'}
