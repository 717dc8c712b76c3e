"""Wrong geometry is named by its cause, by the functions and by the commands."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from PIL import Image
from scipy.spatial.transform import Rotation

import paint_deposition as pd
from booth import SAMPLES, serpentine
from cli.command import COARSE, TRIGGER, assert_refused, figures_of, paint, ran, sheet
from paint_deposition.errors import RecordingError
from paint_deposition.files.recordings.bags import write_pose_bag
from paint_deposition.motion.transforms import Rigid, moved
from refusals import refusal


@pytest.fixture(scope='module')
def panel(tmp_path_factory):
    """A standing panel of 1.2 m by 0.8 m that looks to -y, bulged by 30 mm, as an STL."""
    x, z = np.meshgrid(np.linspace(-0.6, 0.6, 25), np.linspace(-0.4, 0.4, 17), indexing='ij')
    y = 0.03 * ((x / 0.6) ** 2 + (z / 0.4) ** 2) - 0.03
    return sheet(x, y, z, tmp_path_factory.mktemp('panel') / 'panel.stl')


@pytest.fixture(scope='module')
def surface(panel):
    return pd.read_mesh(panel, max_edge_length_m=0.1)


OVER_THE_PANEL = {'half_width_m': 0.9, 'opens_at_m': 0.7, 'speed_m_per_s': 0.4}
# Three level passes at 0.25 m, with a trigger.
PASSES = replace(serpentine((0.3, 0.0, -0.3), **OVER_THE_PANEL), frame_id='base_link')
WITH_ONE_PASS_ABOVE = serpentine((1.3, 0.3, 0.0, -0.3), **OVER_THE_PANEL)
NO_PAINT = 'no paint lands on the part'
QUARTER = Rotation.from_euler('z', 90.0, degrees=True)


def shifted(x: float, y: float, z: float) -> pd.Trajectory:
    return replace(PASSES, positions_m=PASSES.positions_m + np.array([x, y, z]))


def tool_turned(axis: str, degrees: float) -> pd.Trajectory:
    turn = Rotation.from_euler(axis, degrees, degrees=True)
    turned = Rotation.from_quat(PASSES.quaternions_xyzw) * turn
    return replace(PASSES, quaternions_xyzw=turned.as_quat())


def in_another_frame(*origin_m: float) -> pd.Trajectory:
    return moved(PASSES, Rigid.of([*origin_m, *QUARTER.as_quat()]), PASSES.frame_id)


def triggered(flow: float = 1.0, later_s: float = 0.0) -> pd.Trajectory:
    stamps = PASSES.trigger_stamps_ns + int(1e9 * later_s)
    return replace(PASSES, trigger_stamps_ns=stamps, trigger_flow=flow * PASSES.trigger_flow)


def scaled(by: float) -> pd.Trajectory:
    return replace(PASSES, positions_m=by * PASSES.positions_m)


@pytest.mark.slow
def test_a_right_geometry_is_one_line_without_a_warning(panel, tmp_path):
    bag = write_pose_bag(tmp_path / 'bag', PASSES)
    done = paint('simulate', '--mesh', panel, '--trajectory', bag, '--frame-id', 'base_link',
                 *COARSE, *TRIGGER, '--json', '-o', tmp_path / 'out')  # fmt: skip
    assert done.stderr == ''
    found = json.loads(done.stdout)['geometry']
    assert found['passes'] == 3
    assert found['speed_m_per_s'] == pytest.approx(0.4, rel=1e-3)
    # The gun runs 0.25 m before the plane y = 0; the panel bulges from there by up to 30 mm.
    assert 0.22 < found['standoff_low_m'] < found['standoff_m'] < found['standoff_high_m'] < 0.28
    assert 0.0 < found['off_normal_deg'] < 10.0
    # A sheet without folds catches what its straight rays meet.
    capture = json.loads(done.stdout)['capture_fraction']
    assert found['paint_over_part'] == pytest.approx(capture, abs=0.005)
    assert found['warnings'] == []


@pytest.mark.parametrize(('motion', 'words'), [
    (tool_turned('y', 90.0), ['z runs along the travel', 'tool -x points']),
    (tool_turned('x', 90.0), ['z is 9', 'off the surface normal', 'tool +y points']),
    (shifted(0.0, -0.75, 0.0), ['TCP is 0.99', 'the model plane is 0.25 m']),
    (shifted(0.0, 0.15, 0.0), ['TCP is 0.09', 'the model plane is 0.25 m']),
    (shifted(0.75, 0.0, 0.0), ['0.75 m aside', 'toward +x']),
    (shifted(0.0, 0.0, -0.3), ['0.30 m aside', 'toward -z']),
    (shifted(0.0, 0.0, -1.1), ['the passes miss the part', 'span x -0.698 to 0.698']),
    (in_another_frame(0.0, 0.0, 0.0),
     ['another frame than the mesh', "'base_link' span x 0.250 to 0.250, y -0.698 to 0.698"]),
    (scaled(0.001), ['path is 0.002 m long, the part 1.44 m', 'too small']),
    (WITH_ONE_PASS_ABOVE, ['pass 1 of 4 misses the part', 'trigger']),
])  # fmt: skip
def test_an_odd_geometry_is_warned_of_by_its_cause(surface, motion, words):
    (line,) = pd.look_at(surface, motion).geometry.warnings
    assert all(word in line for word in words), line


@pytest.mark.parametrize(('motion', 'words'), [
    (triggered(flow=0.0), ['never sprays', 'none of the 6 messages', '--state-topic']),
    (triggered(later_s=500.0),
     ['never sprays while there are poses', '501 s after', 'one clock']),
    (tool_turned('x', 180.0), [NO_PAINT, 'tool z is reversed']),
    (shifted(0.0, 0.75, 0.0), [NO_PAINT, 'behind the part and looks away', "'base_link'"]),
    (scaled(1000.0), [NO_PAINT, 'look like millimetres', 'in metres']),
    (
        in_another_frame(1.8, 3.2, 1.1),
        [NO_PAINT, 'another frame', "'base_link' span x 2.050 to 2.050", 'y 2.502 to 3.898',
         'z 0.800 to 1.400', 'mesh x -0.600 to 0.600', 'z -0.400 to 0.400', '--part-pose'],
    ),
])  # fmt: skip
def test_a_motion_that_paints_nothing_is_refused_by_its_cause(surface, motion, words):
    line = refusal(RecordingError, pd.simulate, surface, motion)
    assert all(word in line for word in words), line


def test_a_small_mesh_in_millimetres_is_refused(panel, tmp_path):
    """A panel of 40 mm is 40 m in metres: below the size that is refused when it is read."""
    small = trimesh.load_mesh(panel, process=False).apply_scale(1000.0 / 30.0)
    small.apply_translation([60.0, 0.0, 0.0]).export(tmp_path / 'mm.stl')
    surface = pd.read_mesh(tmp_path / 'mm.stl', max_edge_length_m=1.0)
    with pytest.raises(RecordingError, match=r'looks like millimetres.*--mesh-scale 0\.001'):
        pd.simulate(surface, serpentine((0.0,), half_width_m=0.12, opens_at_m=0.1))


@pytest.mark.slow
def test_inspect_says_and_draws_how_the_gun_ran_over_the_door(tmp_path):
    door, run, picture = SAMPLES / 'door.stl', SAMPLES / 'door_horizontal', tmp_path / 'door.png'
    done = ran('inspect', run, '--mesh', door, *TRIGGER, '--out', picture)
    assert done.stderr == ''
    assert done.stdout.startswith('3 passes, 0.30 m/s, TCP 249 mm from the surface')
    assert str(picture) in done.stdout
    with Image.open(picture) as image:
        assert min(image.size) > 1000
        colours = {colour for _, colour in image.convert('RGB').getcolors(1 << 24)}
    assert {(0x00, 0x70, 0x8C), (0xB8, 0xC2, 0xCC)} <= colours  # tool axes, and the part
    figures = figures_of('inspect', run, '--mesh', door, *TRIGGER, '--json')
    assert figures['geometry']['sentence'] == done.stdout.splitlines()[0]
    assert (figures['mesh_file'], figures['picture']) == (str(door), None)


@pytest.mark.parametrize('bag', ['door_vertical', 'measured_door/door'])
def test_the_samples_are_not_warned_of(bag):
    mesh = 'measured_door/door.stl' if bag == 'measured_door/door' else 'door.stl'
    recorded = pd.read_recording(SAMPLES / bag, state_topic='/atomizer/state')
    found = pd.look_at(pd.read_mesh(SAMPLES / mesh, max_edge_length_m=0.1), recorded).geometry
    assert (recorded.warnings, found.warnings) == ((), ())
    assert found.passes == np.sum(np.diff(recorded.trigger_flow) > 0.0)


@pytest.fixture
def campaign(panel, tmp_path):
    """Write a campaign: the panel, readings of a plausible film, and a motion."""

    def written(motion: pd.Trajectory):
        write_pose_bag(tmp_path / 'run', motion)
        x, z = (grid.ravel() for grid in np.meshgrid(np.linspace(-0.4, 0.4, 6), [-0.2, 0.0, 0.2]))
        y = 0.03 * ((x / 0.6) ** 2 + (z / 0.4) ** 2) - 0.03
        film_um = 12.0 - 10.0 * x**2 - 20.0 * z**2
        rows = [','.join(f'{v:.4f}' for v in row) for row in zip(x, y, z, film_um, strict=True)]
        (tmp_path / 'panel.csv').write_text('\n'.join(['x_m,y_m,z_m,thickness_um', *rows]))
        (tmp_path / 'model.yaml').write_text('planar: {K1_cm3_per_s: 1.9}\n')
        (tmp_path / 'campaign.yaml').write_text(
            f'experiments:\n  - {{name: test panel, mesh: {panel}, trajectory: run, '
            'state_topic: /atomizer/state, measurements: panel.csv, frame_id: base_link}\n'
        )
        return tmp_path / 'campaign.yaml', '--model', tmp_path / 'model.yaml'

    return written


@pytest.mark.slow
def test_a_campaign_without_paint_is_refused_by_its_experiment(campaign, tmp_path):
    for command, motion, words in (
        ('compare', tool_turned('x', 180.0), ['no paint lands', 'tool z is reversed']),
        ('diagnose', triggered(flow=0.0), ['never sprays', '--state-topic']),
    ):
        done = paint(command, *campaign(motion), '-o', tmp_path / 'out')
        assert_refused(done, "experiment 'test panel'", *words)
        shutil.rmtree(tmp_path / 'run')


@pytest.mark.slow
def test_a_campaign_says_how_each_part_was_painted_and_warns_of_odd_geometry(campaign, tmp_path):
    done = ran('compare', *campaign(shifted(0.3, 0.0, 0.0)), '-o', tmp_path / 'out')
    figures = json.loads((tmp_path / 'out/comparison.json').read_text())['geometry']['test panel']
    assert f'\ntest panel: {figures["sentence"]}' in done.stdout
    assert figures['sentence'].startswith('3 passes, 0.40 m/s, TCP 239 mm from the surface')
    assert 'warning: test panel: the passes lie 0.30 m aside' in done.stderr
    assert figures['warnings'][0] in done.stderr


def test_a_mesh_that_is_too_coarse_is_warned_of(tmp_path):
    """A panel with a fold of 40 degrees within 60 mm, cut into edges of 24 and of 5 mm."""
    passes = serpentine((0.15, -0.15), half_width_m=0.6, opens_at_m=0.4)

    def seen(edge_m: float):
        x, z = np.meshgrid([-0.3, 0.0, 0.3], np.arange(-0.24, 0.2401, edge_m), indexing='ij')
        y = 0.84 * 0.01 * np.logaddexp(0.0, z / 0.01)
        path = sheet(x, y, z, tmp_path / f'fold{1e3 * edge_m:.0f}.stl')
        return pd.look_at(pd.read_mesh(path, max_edge_length_m=0.05), passes).geometry

    (line,) = seen(0.024).warnings
    assert 'coarser than its curvature allows' in line
    assert 'an edge of 2' in line
    fine = seen(0.0045)
    assert fine.warnings == ()
    assert 0.0 < fine.facet_error < 0.01
