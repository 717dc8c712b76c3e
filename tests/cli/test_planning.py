"""`paint calibrate`, `recommend`, `plan`, `improve` and `measure` as a user runs them."""

import csv
import json

import numpy as np
import pytest
import trimesh
from PIL import Image
from scipy.spatial.transform import Rotation

import paint_deposition as pd
from booth import SAMPLES
from cli.command import figures_of, film_in, paint, ran, rows_of, sheet, told_in
from folded_parts import hood
from paint_deposition.cli.results import MARKER
from paint_deposition.errors import ReadingsError
from paint_deposition.files.rapid.program import read_program
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.model.eq1_pattern import PlanarPattern
from paint_deposition.motion.transforms import Rigid, moved
from paint_deposition.planning.recommendation import recommend
from paint_deposition.planning.requests import IndexRequest

MODEL = pd.DepositionModel(planar=PlanarPattern(K3=0.1))


@pytest.fixture(scope='module')
def model_file(tmp_path_factory):
    path = tmp_path_factory.mktemp('model') / 'model.yaml'
    pd.write_model(path, MODEL)
    return path


def is_picture(path, width: int = 600) -> bool:
    with Image.open(path) as image:
        return image.width > width and len(np.unique(np.asarray(image.convert('L')))) > 20


def test_every_option_of_a_recommendation_which_has_a_folder_by_default(model_file, tmp_path):
    options = (
        '--model', model_file, '--target-um', 20, '--index-min', 0.4, '--index-max', 0.7,
        '--tolerance', 0.2, '--width', 1.2, '--length', 2.0, '--one-way', '--standoff', 0.3,
        '--travel-deg', 90, '--gun-turns',
    )  # fmt: skip
    done = ran('recommend', *options, '--json', cwd=tmp_path)
    folder = tmp_path / 'recommendation'
    names = sorted(path.name for path in folder.iterdir())
    assert names == [MARKER, 'recommendation.json', 'uniformity.png']
    assert is_picture(folder / 'uniformity.png')
    content = json.loads(done.stdout)
    assert content == told_in(folder / 'recommendation.json')
    request = IndexRequest(
        target_um=20.0, index_min_m=0.4, index_max_m=0.7, tolerance=0.2, width_m=1.2,
        length_m=2.0, one_way=True, standoff_m=0.3, travel_rad=np.pi / 2, gun_turns=True,
    )  # fmt: skip
    expected = recommend(MODEL, request)
    assert content.pop('provenance')['models']['model']['planar']
    assert content == json.loads(json.dumps(expected.to_dict()))
    done = paint('recommend', *options, cwd=tmp_path)
    assert expected.sentence in done.stdout
    assert f'SB50 of one pass: {1e3 * expected.sb50_m:.0f} mm' in done.stdout


@pytest.mark.slow
def test_calibration_writes_model_figures_and_pictures(tmp_path):
    done = ran('calibrate', SAMPLES / 'panel_study/campaign.yaml', '-o', tmp_path)
    model = pd.read_model(tmp_path / 'model.yaml')
    assert model.planar.K1_cm3_per_s == pytest.approx(0.653, rel=0.02)
    content = told_in(tmp_path / 'calibration.json')
    assert content['experiments'][0]['residual_sd_um'] < 0.75
    # The panel was painted by eq. (1).
    assert content['footprint']['deviation_of_peak'] < 0.1
    assert 'differs from two Gaussians' not in done.stdout
    assert (content['converged'], content['readings']) == (True, 90)
    assert content['parameters']['r_m']['low'] < 0.231 < content['parameters']['r_m']['high']
    for name in ('collapse.png', 'profiles.png', 'agreement.png'):
        assert is_picture(tmp_path / name)
    assert 'panel_577: 70 points' in done.stdout
    assert 'warning: phi_rad is not determined' in done.stderr


@pytest.mark.slow
def test_plan_writes_bag_table_program_and_film(model_file, tmp_path):
    folder = tmp_path / 'plan'
    done = ran(
        'plan', '--mesh', SAMPLES / 'door.stl', '--model', model_file, '--target-um', 20,
        '--speed-max', 0.1, '-o', folder, '--json', '--paint-moves', '--direction', 'vertical',
    )  # fmt: skip
    content = json.loads(done.stdout)
    assert content == told_in(folder / 'plan.json')
    (warning,) = content['warnings']
    assert warning.endswith('m/s are allowed (--speed-min, --speed-max)')
    assert f'warning: {warning}\n' in done.stderr
    assert content['film']['mean_um'] == pytest.approx(20.0, rel=5e-3)
    assert {path.name for path in folder.iterdir()} == {
        MARKER, 'film.csv', 'film.ply', 'film.png', 'model.yaml', 'passes.csv', 'passes.mod',
        'plan.json', 'stats.json', 'trajectory',
    }  # fmt: skip
    program = read_program(folder / 'passes.mod')
    assert {'paintl', 'movel'} <= {move.instruction for move in program.moves}
    motion = pd.read_recording(folder / 'trajectory')
    assert len(motion) > 1000
    assert np.ptp(motion.positions_m[: len(motion) // 20, 2]) > 0.5
    assert is_picture(folder / 'film.png')


@pytest.mark.slow
@pytest.mark.usefixtures('undrawn')
def test_speeds_along_the_passes_even_the_seams_of_two_faces_further(tmp_path):
    surface, folded = hood(0.06), tmp_path / 'hood.ply'
    trimesh.Trimesh(surface.vertices_m, surface.faces, process=False).export(folded)
    options = ('--faces', 'auto', '--target-um', 20, '--max-edge-length-m', 0.06, '--json')
    plans = []
    free = '--optimise', '--paint-weight', 0, '--time-weight', 0
    for more in (('--keep-off-m', 0.4), free):
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


DOOR_MESH, BAG = SAMPLES / 'door.stl', SAMPLES / 'door_horizontal'
COARSE = ('--max-edge-length-m', 0.06)
RECORDED = ('--mesh', DOOR_MESH, '--trajectory', BAG, '--state-topic', '/atomizer/state', *COARSE)


@pytest.mark.slow
def test_the_improved_film_is_that_of_the_written_files(tmp_path):
    """The bag to the last digits, module and table within what the command says of them."""
    folder = tmp_path / 'out'
    figures = figures_of('improve', *RECORDED, '--json', '-o', folder)
    assert figures['sigma_n']['after'] < 0.8 * figures['sigma_n']['before']
    assert figures['mean_um']['after'] == pytest.approx(figures['mean_um']['before'], rel=0.01)
    assert figures['program_difference'] < 2e-3
    assert [one['number'] for one in figures['passes']] == [1, 2, 3]
    assert 'm/s on average' in figures['passes'][0]['sentence']
    assert {'mesh', 'trajectory'} <= {file['what'] for file in figures['provenance']['files']}
    for name in ('trajectory', 'passes.csv', 'passes.mod', 'model.yaml', 'film.ply'):
        assert (folder / name).exists()
    assert is_picture(folder / 'improvement.png', 1000)
    surface = pd.read_mesh(DOOR_MESH, max_edge_length_m=COARSE[1])
    model = pd.read_model(folder / 'model.yaml')
    expected = film_in(folder)
    within = figures['program_difference'] + 1e-4
    for name, share in (('trajectory', 1e-5), ('passes.mod', within), ('passes.csv', within)):
        film = pd.simulate(surface, pd.read_recording(folder / name), model).film_um
        assert np.abs(film - expected).max() < share * expected.max(), name


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


UNPAINTED = ('--mesh', SAMPLES / 'door.stl', '--max-edge-length-m', 0.05)


@pytest.mark.slow
def test_points_are_written_for_people_and_robots(tmp_path):
    """The filled table is gauge readings, and the empty one is refused."""
    done = ran('measure', *UNPAINTED, '--trajectory', BAG, '--points', 30, '-o', tmp_path)
    figures = told_in(tmp_path / 'measure.json')
    rows, poses = rows_of(tmp_path / 'points.csv'), rows_of(tmp_path / 'poses.csv')
    named = [point['point'] for point in figures['points']]
    assert [row['point'] for row in rows] == named + figures['read_twice']
    assert len(poses) == len(figures['points']) == 30
    assert 'detected with a probability' in done.stdout
    for pose, point in zip(poses, figures['points'], strict=True):
        turn = Rotation.from_quat([float(pose[q]) for q in ('qx', 'qy', 'qz', 'qw')])
        np.testing.assert_allclose(turn.apply([0, 0, 1]), -np.array(point['normal']), atol=1e-6)
    assert is_picture(tmp_path / 'points.png', 1000)
    surface, path = pd.read_mesh(SAMPLES / 'door.stl'), tmp_path / 'points.csv'
    with pytest.raises(ReadingsError, match='no readings below the header'):
        pd.read_readings(path, surface=surface)
    with path.open('w', newline='') as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(row | {'thickness_um': row['expected_um']} for row in rows)
    readings = pd.read_readings(path, surface=surface)
    assert (len(readings), len(set(readings.point))) == (38, 30)
    assert surface.locate(readings.positions_m)[2].max() < 1e-3


@pytest.mark.slow
def test_poses_stand_in_the_frame_of_the_robot(tmp_path):
    pose = (1.0, 0.5, 0.0, 0, 0, 1, 0)
    # The same motion, given in the robot's frame: the part is turned by half a turn there.
    motion = moved(pd.read_recording(SAMPLES / 'door_horizontal'), Rigid.of(pose), 'base_link')
    figures = figures_of(
        'measure', *UNPAINTED, '--trajectory', write_pose_bag(tmp_path / 'run', motion),
        '--part-pose', *pose, '--points', 12, '--repeats', 0, '--json', '-o', tmp_path / 'out',
    )  # fmt: skip
    first = rows_of(tmp_path / 'out/poses.csv')[0]
    assert float(first['x_m']) == pytest.approx(1.0 - figures['points'][0]['x_m'], abs=1e-5)
    assert figures['read_twice'] == []


@pytest.mark.slow
def test_without_a_trajectory_passes_are_planned(tmp_path):
    done = ran('measure', *UNPAINTED, '--target-um', 25, '--points', 16, '--json', '-o', tmp_path)
    films = [point['expected_um'] for point in json.loads(done.stdout)['points']]
    assert np.mean(films) == pytest.approx(25.0, rel=0.2)
