"""The layouts for RViz and Foxglove show what the nodes publish."""

import json

import pytest
import yaml
from rclpy.qos import DurabilityPolicy

from booth import SAMPLES
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


@pytest.fixture
def publishers(start):
    """The publishers of all nodes that a viewer looks at, by topic."""
    panel = SAMPLES / 'panel_study'
    part = {'mesh_file': str(panel / 'panel.stl'), 'max_edge_length_m': 0.1}
    readings = {'measurements_file': str(panel / 'panel_577.csv')}
    made = [
        start(DepositionSimulator, **part),
        start(ModelComparison, **part, **readings),
        start(IndexPlanner),
        start(BagPlayer, bag=str(SAMPLES / 'door_horizontal'), start_paused=True),
    ]
    return {publisher.topic_name: publisher for node in made for publisher in node.publishers}


def type_of(publisher) -> str:
    package, kind, _ = publisher.msg_type.__module__.split('.')
    return f'{package}/{kind}/{publisher.msg_type.__name__}'


def test_rviz_shows_what_is_published_as_it_is_published(publishers):
    manager = yaml.safe_load((LAYOUTS / 'paint.rviz').read_text())['Visualization Manager']
    assert manager['Global Options']['Fixed Frame'] == 'part'
    shown = 0
    for display in manager['Displays']:
        kind = RVIZ[display['Class'].removeprefix('rviz_default_plugins/')]
        if kind:
            topic = display['Topic']
            publisher = publishers['/' + topic['Value']]
            assert type_of(publisher) == kind
            latched = publisher.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
            assert topic['Durability Policy'] == ('Transient Local' if latched else 'Volatile')
            assert display.get('Channel Name', 'thickness_um') == 'thickness_um'
            shown += 1
    assert shown == 7


def test_foxglove_shows_what_is_published(publishers):
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
