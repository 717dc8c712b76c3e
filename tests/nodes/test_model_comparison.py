"""The live comparison with gauge readings over real DDS."""

import numpy as np
import pytest
from std_srvs.srv import Trigger

import paint_deposition as pd
from nodes.cell import offline_um, parameters, two_passes, write_panel
from paint_deposition.effects.catalogue import effect_class
from paint_deposition.files.gauge_readings import write_table
from paint_deposition.files.recordings.messages import stamp_ns
from paint_deposition.nodes.model_comparison import ModelComparison
from paint_deposition.nodes.node import OK, WARN
from paint_deposition.report.colour_scales import BARE_RGB
from scenes import painted

MOTION = two_passes()
TRUTH = pd.DepositionModel().with_effect(effect_class('air_drift')(shift_down_m=0.08))
SIGMA_UM = 0.2
STATS = 'comparison/stats'


@pytest.fixture
def readings(tmp_path):
    """A file of forty noisy readings of the true film, each place measured twice."""
    rng = np.random.default_rng(11)
    surface = pd.read_mesh(write_panel(tmp_path / 'panel.stl'), 1.0, 0.05)
    x, z = rng.uniform(-0.25, 0.25, (2, 20))
    points = surface.at(np.stack([x, 0 * x, z], axis=1))
    film_um = painted(points, MOTION, TRUTH, 'double').gauge_um
    lines = [['x_m', 'y_m', 'z_m', 'thickness_um', 'point', 'sigma_um']]
    for row in np.repeat(np.arange(20), 2).tolist():
        reading = film_um[row] + rng.normal(scale=SIGMA_UM)
        lines.append([f'{x[row]:.6f}', 0, f'{z[row]:.6f}', f'{reading:.4f}', row, SIGMA_UM])
    path = tmp_path / 'readings.csv'
    write_table(path, lines)
    return path


@pytest.fixture
def comparison(start, readings, tmp_path):
    """`comparison(**parameters)`: a comparison with the readings that runs."""
    chosen = {
        'mesh_file': str(tmp_path / 'panel.stl'), 'max_edge_length_m': 0.05,
        'measurements_file': str(readings), 'publish_rate_hz': 10.0, 'pose_queue_depth': 1000,
    }  # fmt: skip
    return lambda **values: start(ModelComparison, **chosen | values)


@pytest.fixture
def viewer(onlooker):
    """A node that looks at the comparison."""
    return onlooker(STATS, 'comparison/mesh', 'comparison/legend')


@pytest.fixture
def truth(tmp_path) -> str:
    """The file of the true model."""
    pd.write_model(tmp_path / 'truth.yaml', TRUTH)
    return str(tmp_path / 'truth.yaml')


def test_the_error_falls_to_the_noise_while_painting(comparison, robot, viewer, wait_until, truth):
    node = comparison(model_file=truth)
    source = robot(node)
    wait_until(lambda: viewer.heard[STATS], what='the bare part')
    errors = []
    for start in range(0, len(MOTION), 200):
        source.send(MOTION, slice(start, start + 200))
        newest = MOTION.stamps_ns[start + 199]
        wait_until(lambda n=newest: viewer.shows(STATS, lambda m: stamp_ns(m.header) == n))
        errors.append(viewer.newest(STATS).rmse_um)
    before_any = viewer.decoded(STATS, 0)
    measured = node.readings.thickness_um
    assert before_any.rmse_um == pytest.approx(np.sqrt(np.mean(measured**2)))
    assert before_any.readings_painted == 0
    assert before_any.rmse_um > errors[0] > errors[1] > errors[2]
    stats = viewer.newest(STATS)
    assert (stats.model, stats.readings, stats.readings_painted) == ('truth.yaml', 40, 40)
    assert stats.rmse_um == pytest.approx(SIGMA_UM, rel=0.3)
    assert stats.chi_square_per_reading == pytest.approx(1.0, abs=0.6)
    assert stats.noise_floor_um == pytest.approx(SIGMA_UM)
    assert abs(stats.worst_residual_um) < 5 * SIGMA_UM


def test_a_better_model_lowers_the_error(comparison, robot, viewer, call, wait_until, truth):
    """Predictions are those of an offline run; a service and colours around readings say it."""
    node = comparison(color_max_um=5.0)
    robot(node).send(MOTION)
    wait_until(lambda: node.film.counts.received == len(MOTION))
    node.publish()
    newest = MOTION.stamps_ns[-1]
    wait_until(lambda: viewer.shows('comparison/mesh', lambda m: stamp_ns(m.header) == newest))
    wait_until(lambda: viewer.newest('comparison/legend'), what='the legend')
    mesh = viewer.newest('comparison/mesh')
    colours = np.array([[c.r, c.g, c.b] for c in mesh.colors])
    corners = np.array([[p.x, p.y, p.z] for p in mesh.points])
    places = node.readings.positions_m
    apart_m = np.linalg.norm(places[::2, None] - places[::2], axis=2) + np.diag([9.0] * 20)
    radius_m = np.clip(1.8 * np.median(apart_m.min(axis=1)), 0.025, 0.09)
    distance = np.linalg.norm(corners[:, None] - places, axis=2).min(axis=1)
    grey = np.abs(colours - np.array(BARE_RGB) / 255.0).max(axis=1) < 1e-6
    assert grey[distance > radius_m + 1e-4].all()
    assert not grey[distance < radius_m - 1e-4].any()
    texts = [m.text for m in viewer.newest('comparison/legend').markers if m.text]
    assert (texts[0], texts[-1]) == ('-5 µm', '5 µm')
    wait_until(lambda: viewer.shows(STATS, lambda m: m.readings_painted == 40))
    without = viewer.newest(STATS)
    assert without.model == 'default model'
    assert without.rmse_um > 3 * SIGMA_UM
    offline = offline_um(node, MOTION, precision='double')
    found = node.residuals()
    assert np.array_equal(found.predicted_um, np.repeat(offline[:20], 2))
    readings_um = node.readings.thickness_um
    assert np.allclose(found.predicted_um + found.residual_um, readings_um, rtol=1e-14)
    answer = call(viewer, Trigger, '/model_comparison/compare')
    assert answer.success
    assert '\n' not in answer.message
    assert f'rms {found.rmse_um:.2f} µm' in answer.message
    assert '40 readings, 40 where' in answer.message
    node.set_parameters(parameters(model_file=truth))
    wait_until(lambda: viewer.shows(STATS, lambda m: m.rmse_um < 1.5 * SIGMA_UM))
    assert viewer.newest(STATS).model == 'truth.yaml'


def test_a_zero_is_warned_of_once_film_is_expected_there(comparison, robot, readings, wait_until):
    table = readings.read_text().splitlines()
    x, y, z, _, *rest = table[1].split(',')
    readings.write_text('\n'.join([table[0], ','.join([x, y, z, '0', *rest]), *table[2:]]))
    node = comparison()
    assert node.status()[0] == OK
    robot(node).send(MOTION)
    wait_until(lambda: node.status()[0] == WARN, what='the warning')
    assert '; 1 of 40 readings are 0 where the model expects' in node.status()[1]


@pytest.mark.parametrize('toward_gun', [True, False])
def test_readings_with_normals_on_a_sheet_that_is_wound_inward(
    comparison, readings, robot, painted, onlooker, wait_until, tmp_path, toward_gun
):
    """They are taken as `paint compare` takes them; those on the side that stays bare are said."""
    write_panel(tmp_path / 'panel.stl', reverse=True)
    heading, *lines = readings.read_text().splitlines()
    normal = f'0,{-1 if toward_gun else 1},0'
    text = '\n'.join([f'{heading},nx,ny,nz', *(f'{line},{normal}' for line in lines)])
    readings.write_text(f'{text}\n')
    node = comparison()
    viewer, source = onlooker(), robot(node)
    source.send(MOTION)
    painted(node)
    if toward_gun:
        offline = offline_um(node, MOTION, precision='double')
        assert np.array_equal(node.film.snapshot().film_um, offline)
        assert node.residuals().painted.all()
    else:
        told = 'the gun paints the other side of the part'
        wait_until(lambda: viewer.reports('model_comparison: film', told, b'\x01'), what=told)
        assert node.set_parameters_atomically(parameters(model_file='')).successful
        wait_until(lambda: not node.repainting, what='the model')
        assert told in node.tasks['film']()[1]
