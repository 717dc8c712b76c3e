"""The files in config/: examples that work as they stand, and views of what is published."""

import json
import re
from pathlib import Path

import pytest
import yaml

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.files.campaign_file import _Entry, _File, read_campaign
from paint_deposition.files.gauge_readings import read_readings
from paint_deposition.files.model_file import read_model
from paint_deposition.files.motion_source import MOTION_KINDS

REQUIRED = ('x_m', 'y_m', 'z_m', 'thickness_um')
OPTIONAL = ('point', 'group', 'sigma_um', 'nx', 'ny', 'nz')
# What a display of RViz shows.
SHOWN = {
    'Marker': 'visualization_msgs/msg/Marker', 'MarkerArray': 'visualization_msgs/msg/MarkerArray',
    'PointCloud2': 'sensor_msgs/msg/PointCloud2', 'Path': 'nav_msgs/msg/Path',
    'Pose': 'geometry_msgs/msg/PoseStamped',
}  # fmt: skip


REPOSITORY = Path(__file__).resolve().parent.parent
CONFIG = REPOSITORY / 'config'
PACKAGE = REPOSITORY / 'ros2_ws/src/paint_deposition'
LAYOUTS, SAMPLES = PACKAGE / 'config', PACKAGE / 'samples'


@pytest.fixture
def publishers(ros_context, executor):
    """The publishers of all nodes that a viewer looks at, by topic."""
    from nodes.cell import parameters
    from paint_deposition.nodes.comparison.model_comparison import ModelComparison
    from paint_deposition.nodes.painting.deposition_simulator import DepositionSimulator
    from paint_deposition.nodes.planning.index_planner import IndexPlanner
    from paint_deposition.nodes.replay.bag_player import BagPlayer

    panel = SAMPLES / 'panel_study'
    part = {'mesh_file': str(panel / 'panel.stl'), 'max_edge_length_m': 0.1}
    readings = {'measurements_file': str(panel / 'panel_577.csv')}
    replay = {'bag': str(SAMPLES / 'door_horizontal'), 'start_paused': True}
    nodes = {
        DepositionSimulator: part, ModelComparison: part | readings, IndexPlanner: {},
        BagPlayer: replay,
    }  # fmt: skip
    made = [n(context=ros_context, parameter_overrides=parameters(**v)) for n, v in nodes.items()]
    for node in made:
        executor.add_node(node)
    return {publisher.topic_name: publisher for node in made for publisher in node.publishers}


def type_of(publisher) -> str:
    package, kind, _ = publisher.msg_type.__module__.split('.')
    return f'{package}/{kind}/{publisher.msg_type.__name__}'


def test_model_is_the_default_one_and_readings_are_readings():
    assert read_model(CONFIG / 'model.yaml') == DepositionModel()
    readings = read_readings(CONFIG / 'readings.csv')
    assert len(readings) == 3
    assert len(set(readings.point)) == 2
    text = (CONFIG / 'readings.csv').read_text()
    assert all(re.search(rf'\b{name}\b', text) for name in (*REQUIRED, *OPTIONAL))


@pytest.mark.slow
def test_campaign_names_every_key_and_can_be_read_with_all_of_them(tmp_path):
    text = (CONFIG / 'campaign.yaml').read_text()
    for key in (*_File.model_fields, *_Entry.model_fields):
        assert re.search(rf'^[ -]*(# )?(- )?{key}:', text, re.M), key
    text = text.replace('../ros2_ws', str(CONFIG.parent / 'ros2_ws'))
    text = re.sub(r'^    # (\w+: )', r'    \1', text, flags=re.M).replace('0.001', '1.0')
    text = text.replace('points.csv', str(SAMPLES / 'measured_door' / 'door.csv'))
    text = re.sub(r'^ *sheet: .*\n', '', text, flags=re.M)  # a CSV file has no sheets
    entries = yaml.safe_load(text)['experiments']
    # Keys of other kinds of motion stand by themselves: no recording has them all.
    others = {'sheet', 'frame_id', 'guns', *MOTION_KINDS} - {'pose_topic', 'state_topic'}
    assert set(_Entry.model_fields) - others <= set(entries[-1])
    campaign = tmp_path / 'campaign.yaml'
    campaign.write_text(text)
    assert [experiment.name for experiment in read_campaign(campaign).experiments] == [
        'panel', 'door',
    ]  # fmt: skip


def test_viewers_show_what_is_published_as_it_is_published(publishers):
    from rclpy.qos import DurabilityPolicy

    manager = yaml.safe_load((LAYOUTS / 'paint.rviz').read_text())['Visualization Manager']
    assert manager['Global Options']['Fixed Frame'] == 'part'
    shown = [display for display in manager['Displays'] if 'Topic' in display]
    assert len(shown) == 7
    for display in shown:
        publisher = publishers['/' + display['Topic']['Value']]
        assert type_of(publisher) == SHOWN[display['Class'].removeprefix('rviz_default_plugins/')]
        latched = publisher.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
        assert latched == (display['Topic']['Durability Policy'] == 'Transient Local')
    (cloud,) = (display for display in shown if 'Channel Name' in display)
    assert cloud['Channel Name'] == 'thickness_um'
    _foxglove_shows_topics_and_fields_that_there_are(publishers)


def _foxglove_shows_topics_and_fields_that_there_are(publishers):
    layout = json.loads((LAYOUTS / 'foxglove.json').read_text())
    panels = layout['configById']
    assert set(panels) == set(panels_of(layout['layout']))
    scene = panels['3D!part']
    assert scene['followTf'] == 'part'
    assert set(scene['topics']) <= set(publishers)
    assert scene['topics']['/thickness/cloud']['colorField'] == 'thickness_um'
    titled = [panel for panel in panels.values() if 'foxglovePanelTitle' in panel]
    assert len(titled) == 4
    assert all(p['lichtblickPanelTitle'] == p['foxglovePanelTitle'] for p in titled)
    plots = [panel for name, panel in panels.items() if name.startswith('Plot!')]
    paths = [path['value'] for plot in plots for path in plot['paths']]
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
