"""Coats through the commands: films, wet films and readings of one layer or several."""

import numpy as np
import pytest
import trimesh
import yaml

import paint_deposition as pd
from booth import LOOKING_ALONG_Y, SAMPLES
from brushes import NARROW, WIDE
from cli.command import ran, rows_of, told_in
from paint_deposition.effects.library.sag import Sag
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.inference.fitting.forward import Forward
from paint_deposition.model.eq1_pattern import Brush
from scenes import straight_pass

PANEL = SAMPLES / 'panel.stl'
TIMES_S = np.arange(0.0, 3.0, 0.02)
COATS = {
    'base': straight_pass(TIMES_S, (-0.5, -0.25, 1.1), (0.5, -0.25, 1.1), LOOKING_ALONG_Y),
    'clear': straight_pass(TIMES_S, (0.1, -0.25, 1.4), (0.1, -0.25, 0.6), LOOKING_ALONG_Y),
}
LAYERS = ('base', 'clear', 'base+clear')
# 0.5 and 0.25 of the paint are solids; the flow of the base coat is not known.
TWO_PAINTS = [
    pd.DepositionModel.of_brushes([Brush(number=1, planar=planar, solids=solids, **more)])
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


def campaign(folder, said=({}, {}), **more):
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


@pytest.mark.parametrize('wet_on_wet', [False, True])
def test_a_campaign_predicts_each_layer_as_simulate_does(folder, wet_on_wet):
    model = pd.DepositionModel().with_effect(Sag(run_m=0.01))
    taken_um = write_readings(folder, model, LAYERS, wet_on_wet=wet_on_wet)
    read = pd.read_campaign(campaign(folder, ({}, {'wet_on_wet': wet_on_wet})))
    assert [one.name for one in read.experiments] == [
        f'panel: {x}' for x in (*LAYERS[:2], 'total')
    ]
    predicted_um = Forward(read).predict_um(model)[read.means.owner]
    assert predicted_um == pytest.approx(taken_um, abs=1e-5)
    terms_um = Forward(read, model.effects).terms(model).with_gains_um(model.patterns)
    assert terms_um[read.means.owner] == pytest.approx(taken_um, abs=1e-5)


def test_wet_readings_are_dried_by_the_solids_of_their_coat(folder):
    taken_um = write_readings(folder, pd.DepositionModel(), LAYERS[:2])
    solids = {'solids': 0.5}, {'solids': 0.25}
    dried = pd.read_campaign(campaign(folder, solids, wet=True, under_um=3.0)).readings
    expected_um = np.repeat([0.5, 0.25], 48) * taken_um
    assert dried.thickness_um == pytest.approx(expected_um)
    with pytest.raises(pd.PaintError, match="the solids of layer 'base' are not said; give"):
        pd.read_campaign(campaign(folder, wet=True))
    write_readings(folder, pd.DepositionModel(), ['total'])
    with pytest.raises(pd.PaintError, match="the solids of layer 'total' differ; give"):
        pd.read_campaign(campaign(folder, solids, wet=True))
    # With a known film below: it is part of what was read of all coats.
    below = [pd.read_campaign(campaign(folder, under_um=um)).readings for um in (0.0, 3.0)]
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
        pd.read_campaign(campaign(folder, **more))


def test_a_column_of_wet_film_tells_the_remedy(folder):
    (folder / 'readings.csv').write_text('x_m,y_m,z_m,Nassschichtdicke [µm]\n0,0,0,40\n')
    with pytest.raises(pd.PaintError, match=r'is a wet film: say wet: true, give its solids'):
        pd.read_campaign(campaign(folder))
    named = {'columns': {'thickness': 'Nassschichtdicke [µm]'}, 'wet': True, 'solids': 0.5}
    readings = pd.read_campaign(campaign(folder, **named)).readings
    assert readings.thickness_um.tolist() == [20.0]


def test_residuals_name_their_layer(folder, tmp_path):
    write_readings(folder, pd.DepositionModel(), ['base', 'total'])
    pd.write_model(tmp_path / 'model.yaml', pd.DepositionModel())
    ran('compare', campaign(folder), '--model', tmp_path / 'model.yaml', '-o', tmp_path)
    rows = rows_of(tmp_path / 'residuals.csv')
    assert list(rows[0])[-1] == 'layer'
    for row in rows:
        assert row['experiment'] == f'panel: {row["layer"]}'
    assert {row['layer'] for row in rows} == {'base', 'total'}
