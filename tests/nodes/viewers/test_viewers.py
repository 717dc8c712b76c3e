"""What viewers show: layouts for RViz and Foxglove, and runs that Foxglove and Rerun read."""

import json
import os
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import yaml
from paint_msgs.msg import ThicknessField
from rclpy.qos import DurabilityPolicy
from rclpy.serialization import deserialize_message

from booth import SAMPLES
from nodes.bags.runs import finish, messages
from nodes.cell import two_passes
from paint_deposition.nodes.bags.bag_player import BagPlayer
from paint_deposition.nodes.index_planner import IndexPlanner
from paint_deposition.nodes.model_comparison import ModelComparison
from paint_deposition.nodes.painting.deposition_simulator import DepositionSimulator

LAYOUTS = SAMPLES.parent / 'config'
# What a display of RViz shows.
RVIZ = {
    'Grid': '', 'Marker': 'visualization_msgs/msg/Marker',
    'MarkerArray': 'visualization_msgs/msg/MarkerArray',
    'PointCloud2': 'sensor_msgs/msg/PointCloud2', 'Path': 'nav_msgs/msg/Path',
    'Pose': 'geometry_msgs/msg/PoseStamped',
}  # fmt: skip


def test_layouts_show_what_is_published_as_it_is_published(start):
    panel = SAMPLES / 'panel_study'
    part = {'mesh_file': str(panel / 'panel.stl'), 'max_edge_length_m': 0.1}
    readings = {'measurements_file': str(panel / 'panel_577.csv')}
    made = [
        start(DepositionSimulator, **part),
        start(ModelComparison, **part, **readings),
        start(IndexPlanner),
        start(BagPlayer, bag=str(SAMPLES / 'door_horizontal'), start_paused=True),
    ]
    publishers = {each.topic_name: each for node in made for each in node.publishers}

    manager = yaml.safe_load((LAYOUTS / 'paint.rviz').read_text())['Visualization Manager']
    assert manager['Global Options']['Fixed Frame'] == 'part'
    shown = 0
    for display in manager['Displays']:
        kind = RVIZ[display['Class'].removeprefix('rviz_default_plugins/')]
        if kind:
            topic = display['Topic']
            publisher = publishers['/' + topic['Value']]
            package, *_ = publisher.msg_type.__module__.split('.')
            assert f'{package}/msg/{publisher.msg_type.__name__}' == kind
            latched = publisher.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
            assert topic['Durability Policy'] == ('Transient Local' if latched else 'Volatile')
            assert display.get('Channel Name', 'thickness_um') == 'thickness_um'
            shown += 1
    assert shown == 7

    layout = json.loads((LAYOUTS / 'foxglove.json').read_text())
    panels = layout['configById']
    assert set(panels) == set(panels_of(layout['layout']))
    scene = panels['3D!part']
    assert scene['followTf'] == 'part'
    for topic, layer in scene['topics'].items():
        assert topic in publishers
        assert layer.get('colorField', 'thickness_um') == 'thickness_um'
    paths = [path['value'] for panel in panels.values() for path in panel.get('paths', ())]
    assert len(paths) == 11
    for path in paths:
        topic, field = path.rsplit('.', 1)
        assert field in publishers[topic].msg_type.get_fields_and_field_types(), path
    assert panels['DiagnosticSummary!health']['topicToRender'] in publishers


def panels_of(layout) -> list[str]:
    """Names of the panels in a layout's tree."""
    if isinstance(layout, str):
        return [layout]
    return [*panels_of(layout['first']), *panels_of(layout['second'])]


HERE = Path(__file__).parent
POSES = 100


@pytest.fixture
def run(simulator, record, robot, painted, wait_until):
    """The messages of a run with poses and the film that they gave, and its file."""
    node = simulator(max_edge_length_m=0.1, publish_rate_hz=20.0)
    recorder = record()
    arm, count = robot(node, recorder), recorder.run.counts.get
    wait_until(lambda: count('/thickness/field'), what='the bare part recorded')
    bare = count('/thickness/field')
    arm.send(two_passes(POSES))
    painted(node, POSES)
    wait_until(lambda: count('/atomizer/pose') == POSES, what='every pose recorded')
    wait_until(lambda: count('/thickness/field') > bare, what='the film recorded')
    finish(recorder)
    (path,) = recorder.run.folder.glob('*.mcap')
    return messages(path), path


@pytest.fixture(scope='session')
def libraries():
    """Install those of npm, once for a checkout."""
    if shutil.which('npm') is None:
        pytest.skip('npm is not installed')
    if not (HERE / 'node_modules').is_dir():
        install = ['npm', 'ci', '--ignore-scripts', '--no-audit', '--prefer-offline']
        if subprocess.run(install, cwd=HERE, capture_output=True, timeout=120).returncode:
            pytest.skip('the registry of npm cannot be reached')


@pytest.mark.slow
def test_foxglove_reads_poses_film_and_what_is_latched(libraries, run):
    recorded, path = run
    command = ['node', HERE / 'read_run.mjs', path]
    topics = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)
    names = [name for name, _ in recorded]
    assert {n: found['count'] for n, found in topics.items()} == {n: names.count(n) for n in names}
    x, y, z = two_passes(POSES).positions_m[-1]
    assert topics['/atomizer/pose']['newest']['pose']['position'] == {'x': x, 'y': y, 'z': z}
    film, field = topics['/thickness/field']['newest'], dict(recorded)['/thickness/field']
    field = deserialize_message(field, ThicknessField)
    assert max(field.thickness_um) > 1.0
    assert np.array_equal(np.float32(film['thickness_um']), field.thickness_um)
    assert (film['mesh_id'], film['header']['frame_id']) == (field.mesh_id, 'part')
    cloud = topics['/thickness/cloud']['newest']
    assert [one['name'] for one in cloud['fields']] == ['x', 'y', 'z', 'thickness_um']
    assert cloud['width'] == len(field.thickness_um)
    assert 'transient_local' in topics['/thickness/stats']['qos']


@pytest.mark.slow
@pytest.mark.skipif(find_spec('rerun') is None, reason='rerun-sdk is not installed')
def test_rerun_reads_every_topic(run, tmp_path):
    recorded, path = run

    def rerun(*arguments: object) -> str:
        command = [sys.executable, '-m', 'rerun', *map(str, arguments)]
        done = subprocess.run(
            command, env=os.environ | {'HOME': str(tmp_path)}, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        return done.stdout + done.stderr

    rerun('mcap', 'convert', path, '-o', tmp_path / 'run.rrd')
    rerun('rrd', 'verify', tmp_path / 'run.rrd')
    figures = rerun('rrd', 'stats', tmp_path / 'run.rrd')
    assert all(f'\n{topic}: ' in figures for topic, _ in recorded)
