"""`paint simulate` over real files, as a user runs it, and zones."""

import json
import shutil

import numpy as np
import pytest
import trimesh
import yaml

import paint_deposition as pd
from booth import SAMPLES
from cli.command import COARSE, assert_refused, film_in, level_pass, paint, ran, rows_of, told_in
from paint_deposition.cli.results import MARKER
from paint_deposition.effects.library.gauge_gain import GaugeGain
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.part.points import SurfacePoints
from reference import reference_film_um

DOOR, DOOR_BAG = SAMPLES / 'door.stl', SAMPLES / 'door_horizontal'


@pytest.mark.slow
def test_the_door_is_painted_and_figures_say_how(tmp_path):
    folder = tmp_path / 'new' / 'folder'
    done = ran(
        'simulate', '--mesh', DOOR, '--trajectory', DOOR_BAG, '--state-topic', '/atomizer/state',
        '--json', '-o', folder, '--target-um', 18, '--tolerance-um', 4,
    )  # fmt: skip
    figures = json.loads(done.stdout)
    assert done.stderr == ''
    names = sorted(file.name for file in folder.iterdir())
    assert names == [MARKER, 'film.csv', 'film.ply', 'film.png', 'stats.json']
    assert told_in(folder / 'stats.json') == figures
    assert list(rows_of(folder / 'film.csv')[0]) == ['x_m', 'y_m', 'z_m', 'thickness_um']
    film = film_in(folder)
    assert film.max() == pytest.approx(figures['max_um'])
    assert 10.0 < figures['mean_um'] < 30.0
    assert figures['coverage'] > 0.99
    assert 0.0 < figures['within_target'] < 1.0
    mesh = trimesh.load_mesh(folder / 'film.ply', process=False)
    in_mesh = np.ravel(mesh.metadata['_ply_raw']['vertex']['data']['thickness_um'])
    assert np.allclose(in_mesh, film, rtol=1e-6)
    assert (folder / 'film.png').read_bytes().startswith(b'\x89PNG')
    recorded = pd.read_recording(DOOR_BAG, None, '/atomizer/state')
    assert (figures['poses']['received'], figures['poses']['rejected']) == (len(recorded), 0)
    changes = recorded.trigger_stamps_ns[1:]
    on_s = np.sum(changes[1::2] - changes[0::2]) * 1e-9
    assert figures['spraying_time_s'] == pytest.approx(on_s, rel=1e-9)
    emitted = pd.DepositionModel().planar.K1_cm3_per_s * on_s
    assert figures['emitted_volume_cm3'] == pytest.approx(emitted, rel=1e-9)
    share = figures['painted_volume_cm3'] / emitted
    assert figures['capture_fraction'] == pytest.approx(share, rel=1e-9)
    assert figures['down'] == [0.0, 0.0, -1.0]
    assert figures['mesh_file'] == str(DOOR)


def test_predictions_are_exact_at_the_readings(panel, one_pass, tmp_path):
    """Eqs. (1) and (2) summed in NumPy, and the gauge, which is not in the film."""
    rng = np.random.default_rng(8)
    x, z = np.round([rng.uniform(-0.5, 0.5, 12), rng.uniform(-0.3, 0.3, 12)], 6)
    x[1], z[1] = x[0], z[0]  # a repeat
    readings = tmp_path / 'readings.csv'
    rows = [f'p{max(k, 1)},{x[k]:.6f},0.004,{z[k]:.6f},{k},"a, b"\n' for k in range(12)]
    readings.write_text(''.join(['point,x_m,y_m,z_m,thickness_um,remark\n', *rows]))
    model = pd.DepositionModel(planar=PlanarPattern(K1_cm3_per_s=1.2, K3=0.4, phi_rad=1.0))
    pd.write_model(tmp_path / 'model.yaml', model.with_effect(GaugeGain(gain=0.1)))
    done = ran(
        'simulate', '--mesh', panel, '--trajectory', one_pass, '--model', tmp_path / 'model.yaml',
        '--at', readings, *COARSE, '-o', tmp_path / 'out',
    )  # fmt: skip
    assert '\nwarning: 1 of 12 readings are 0 where the model expects' in done.stderr
    lines = (tmp_path / 'out/predicted.csv').read_text().splitlines()
    assert lines[0] == 'point,x_m,y_m,z_m,thickness_um,remark,predicted_um'
    assert [line.rsplit(',', 1)[0] for line in lines] == readings.read_text().splitlines()
    predicted = np.array([float(line.rsplit(',', 1)[1]) for line in lines[1:]])
    points = SurfacePoints(np.stack([x, 0 * x, z], axis=1), np.tile([0, -1.0, 0], (12, 1)))
    expected = 1.1 * reference_film_um(points, spray_path(level_pass())[0], model)
    assert expected.max() > 5.0
    assert np.abs(predicted - expected).max() < 1e-4
    plain = pd.simulate(pd.read_mesh(panel, max_edge_length_m=COARSE[1]), level_pass(), model)
    assert film_in(tmp_path / 'out') == pytest.approx(plain.film_um, rel=1e-6)


def test_a_log_with_a_gap_and_a_log_pasted_twice_are_warned_of_before_the_film(tmp_path):
    rows = [f'{k / 50},{k / 50 - 1},-0.25,0.5,-0.70710678,0,0,0.70710678' for k in range(101)]
    log = tmp_path / 'log.csv'
    for taken, words in (
        ([*rows[:30], *rows[60:]], 'a gap in the poses while'),
        (rows * 2, 'as if the log were in the file twice'),
    ):
        log.write_text('\n'.join(['t,x_m,y_m,z_m,qx,qy,qz,qw', *taken]))
        given = ('--mesh', DOOR, '--trajectory', log, *COARSE)
        done = paint('simulate', *given, '-o', tmp_path / 'out')
        (line,) = (line for line in done.stderr.splitlines() if words in line)
        assert line.startswith('warning: ')
        told = told_in(tmp_path / 'out/stats.json')['warnings']
        assert line.removeprefix('warning: ') in told


ZONES = """zones:
  - {name: foot, target_um: 20, tolerance_um: 2, box: [[-2, -2, -2], [2, 2, 0.0]]}
  - {name: 'head, left', target_um: 9, tolerance_um: 1, box: [[-2, -2, 0.0], [0, 2, 2]]}
"""


@pytest.fixture
def zones(tmp_path):
    path = tmp_path / 'zones.yaml'
    path.write_text(ZONES)
    return path


def test_simulate_counts_each_zone_against_its_band(panel, one_pass, zones, tmp_path):
    given = ('--mesh', panel, '--trajectory', one_pass, '--zones', zones, *COARSE)
    done = ran('simulate', *given, '-o', tmp_path / 'out')
    figures = told_in(tmp_path / 'out/stats.json')
    foot, head = figures['zones']
    assert [foot['name'], head['name']] == ['foot', 'head, left']
    assert (foot['target_um'], head['target_tolerance_um']) == (20.0, 1.0)
    assert f'head, left, 9 ± 1 µm: {head["mean_um"]:.1f} µm mean' in done.stdout
    rows = rows_of(tmp_path / 'out/film.csv')
    assert list(rows[0])[4:] == ['zone']
    assert {row['zone'] for row in rows} == {'foot', 'head, left', ''}
    low = [row for row in rows if float(row['z_m']) <= 0.0]
    assert low == [row for row in rows if row['zone'] == 'foot']
    highest_um = max(float(row['thickness_um']) for row in low)
    assert highest_um == pytest.approx(foot['max_um'])
    zones.write_text(ZONES.replace('0.0]]}', '-1.0]]}'))
    done = paint('simulate', *given, '-o', tmp_path / 'out')
    assert_refused(done, "zone 'foot' holds no vertex of the part")


@pytest.mark.slow
def test_compare_tells_the_readings_of_each_zone(zones, tmp_path):
    """By --zones, which stands for the campaign's own."""
    shutil.copytree(SAMPLES / 'measured_door', tmp_path, dirs_exist_ok=True)
    file = tmp_path / 'unseen.yaml'
    campaign = yaml.safe_load(file.read_text())
    (tmp_path / 'other.yaml').write_text(ZONES.replace('0.0', '0.3').replace(' 20,', ' 22,'))
    file.write_text(json.dumps(campaign | {'zones': 'other.yaml', 'model': 'bell.yaml'}))
    (tmp_path / 'bell.yaml').write_text('{}')
    done = ran('compare', file, '-o', tmp_path / 'out')
    foot, _ = told_in(tmp_path / 'out/comparison.json')['zones']
    rows = rows_of(tmp_path / 'out/residuals.csv')
    own = [row for row in rows if float(row['z_m']) <= 0.3 and row['used'] == '1']
    film = np.array([float(row['thickness_um']) for row in own])
    assert (foot['readings'], foot['target_um']) == (len(own), 22.0)
    assert foot['mean_um'] == pytest.approx(film.mean(), abs=1e-3)
    within = np.mean(np.abs(film - 22.0) <= 2.0)
    assert foot['within'] == pytest.approx(within)
    assert foot['verdict'] == f'{round((1 - within) * len(own))} of {len(own)} out'
    predicted = np.mean([float(row['predicted_um']) for row in own])
    assert foot['mean_predicted_um'] == pytest.approx(predicted, abs=1e-3)
    assert abs(foot['worst_um'] - 22.0) == pytest.approx(np.abs(film - 22.0).max(), abs=1e-3)
    assert 'door: foot, 22 ± 2 µm:' in done.stdout
    page = (tmp_path / 'out/report.html').read_text()
    assert '<h2 id="zones">Zones</h2>' in page
    assert f'worst {foot["worst_um"]:.1f} µm at {foot["worst_point"]}' in page
    zones.write_text(ZONES.replace('0.0]]}', '-1.0]]}'))
    refused = paint('compare', file, '--zones', zones, '-o', tmp_path / 'out')
    assert_refused(refused, "experiment 'door'", "zone 'foot' holds no vertex")
