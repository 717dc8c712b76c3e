"""The layouts for RViz and Foxglove: settings that the viewers know, of what the nodes publish."""

import json

import pytest
import yaml
from rclpy.qos import DurabilityPolicy

from booth import SAMPLES

LAYOUTS = SAMPLES.parent / 'config'
# What a display of RViz shows, and its settings as they are called in the sources of RViz.
RVIZ = {
    'Grid': ('', {'Alpha', 'Cell Size', 'Plane', 'Plane Cell Count', 'Reference Frame'}),
    'Marker': ('visualization_msgs/msg/Marker', {'Namespaces'}),
    'MarkerArray': ('visualization_msgs/msg/MarkerArray', {'Namespaces'}),
    'PointCloud2': ('sensor_msgs/msg/PointCloud2', {
        'Autocompute Intensity Bounds', 'Channel Name', 'Color Transformer', 'Invert Rainbow',
        'Position Transformer', 'Size (Pixels)', 'Style', 'Use Fixed Frame', 'Use rainbow',
    }),
    'Path': ('nav_msgs/msg/Path', {'Alpha', 'Color', 'Line Style', 'Pose Style'}),
    'Pose': ('geometry_msgs/msg/PoseStamped', {'Axes Length', 'Axes Radius', 'Shape'}),
}  # fmt: skip
OF_EVERY_DISPLAY = {'Class', 'Name', 'Enabled', 'Value'}
OF_A_TOPIC = {'Value', 'Depth', 'History Policy', 'Reliability Policy', 'Durability Policy'}
# Settings of a panel, and of a topic in the 3D panel by its type, as Lichtblick declares them.
PANELS = {
    '3D': {
        'followTf', 'followMode', 'cameraState', 'scene', 'transforms', 'layers', 'publish',
        'topics',
    },
    'Plot': {
        'paths', 'xAxisVal', 'minYValue', 'maxYValue', 'showLegend', 'legendDisplay', 'isSynced',
        'showXAxisLabels', 'showYAxisLabels',
    },
    'DiagnosticSummary': {
        'topicToRender', 'minLevel', 'pinnedIds', 'hardwareIdFilter', 'sortByLevel',
    },
}  # fmt: skip
TITLES = {'foxglovePanelTitle', 'lichtblickPanelTitle'}
OF_A_PATH = {'value', 'label', 'enabled', 'timestampMethod'}
LAYERS = {
    'Marker': set(), 'MarkerArray': set(),
    'PointCloud2': {
        'pointSize', 'pointShape', 'colorMode', 'colorField', 'colorMap', 'explicitAlpha',
    },
    'Path': {'type', 'lineWidth'}, 'PoseStamped': {'type', 'axisScale'},
}  # fmt: skip


@pytest.fixture
def publishers(ros_context, spin):
    """The publishers of all nodes that a viewer looks at, by topic."""
    from nodes.cell import parameters
    from paint_deposition.nodes.bags.bag_player import BagPlayer
    from paint_deposition.nodes.index_planner import IndexPlanner
    from paint_deposition.nodes.model_comparison import ModelComparison
    from paint_deposition.nodes.painting.deposition_simulator import DepositionSimulator

    panel = SAMPLES / 'panel_study'
    part = {'mesh_file': str(panel / 'panel.stl'), 'max_edge_length_m': 0.1}
    readings = {'measurements_file': str(panel / 'panel_577.csv')}
    replay = {'bag': str(SAMPLES / 'door_horizontal'), 'start_paused': True}
    nodes = {
        DepositionSimulator: part, ModelComparison: part | readings, IndexPlanner: {},
        BagPlayer: replay,
    }  # fmt: skip
    made = [n(context=ros_context, parameter_overrides=parameters(**v)) for n, v in nodes.items()]
    spin(*made)
    return {publisher.topic_name: publisher for node in made for publisher in node.publishers}


def type_of(publisher) -> str:
    package, kind, _ = publisher.msg_type.__module__.split('.')
    return f'{package}/{kind}/{publisher.msg_type.__name__}'


def test_layouts_show_what_is_published_as_it_is_published(publishers):
    _check_rviz(publishers)
    _check_foxglove(publishers)


def _check_rviz(publishers):
    manager = yaml.safe_load((LAYOUTS / 'paint.rviz').read_text())['Visualization Manager']
    assert manager['Global Options']['Fixed Frame'] == 'part'
    shown = 0
    for display in manager['Displays']:
        kind, settings = RVIZ[display['Class'].removeprefix('rviz_default_plugins/')]
        assert display.keys() - OF_EVERY_DISPLAY - {'Topic'} <= settings, display['Name']
        if kind:
            topic = display['Topic']
            assert topic.keys() == OF_A_TOPIC
            publisher = publishers['/' + topic['Value']]
            assert type_of(publisher) == kind
            latched = publisher.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
            assert topic['Durability Policy'] == ('Transient Local' if latched else 'Volatile')
            assert display.get('Channel Name', 'thickness_um') == 'thickness_um'
            shown += 1
    assert shown == 7


def _check_foxglove(publishers):
    layout = json.loads((LAYOUTS / 'foxglove.json').read_text())
    panels = layout['configById']
    assert set(panels) == set(panels_of(layout['layout']))
    for name, panel in panels.items():
        assert panel.keys() - TITLES <= PANELS[name.split('!')[0]], name
        assert panel.get('lichtblickPanelTitle') == panel.get('foxglovePanelTitle')
    scene = panels['3D!part']
    assert scene['followTf'] == 'part'
    for topic, layer in scene['topics'].items():
        settings = LAYERS[type_of(publishers[topic]).split('/')[-1]]
        assert layer.keys() - {'visible'} == settings, topic
        assert layer.get('colorField', 'thickness_um') == 'thickness_um'
    paths = [path for panel in panels.values() for path in panel.get('paths', ())]
    assert len(paths) == 11
    for path in paths:
        assert path.keys() == OF_A_PATH
        topic, field = path['value'].rsplit('.', 1)
        assert field in publishers[topic].msg_type.get_fields_and_field_types(), path
    assert panels['DiagnosticSummary!health']['topicToRender'] in publishers


def panels_of(layout) -> list[str]:
    """Names of the panels in a layout's tree."""
    if isinstance(layout, str):
        return [layout]
    return [*panels_of(layout['first']), *panels_of(layout['second'])]
