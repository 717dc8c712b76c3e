"""The policies of the nodes allow what the nodes do, and name nothing that is not there."""

from xml.etree import ElementTree

import pytest
from rclpy.action import get_action_server_names_and_types_by_node

from booth import SAMPLES
from nodes.cell import parameters
from paint_deposition.nodes.atomizer_source import AtomizerSource
from paint_deposition.nodes.bags.bag_player import BagPlayer
from paint_deposition.nodes.bags.recorded_topic import default_topics
from paint_deposition.nodes.bags.run_recorder import RunRecorder
from paint_deposition.nodes.controllers import OpcuaSource, RwsSource
from paint_deposition.nodes.egm_source import EgmSource
from paint_deposition.nodes.index_planner import IndexPlanner
from paint_deposition.nodes.managed_node import ManagedNode
from paint_deposition.nodes.model_comparison import ModelComparison
from paint_deposition.nodes.painting.deposition_simulator import DepositionSimulator
from paint_deposition.nodes.web_view import WebView
from robot_arm import URDF

PANEL = {'mesh_file': str(SAMPLES / 'panel_study/panel.stl'), 'max_edge_length_m': 0.2}
PLACE = {'part_pose': [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], 'part_parent_frame': 'base'}
NODES = {
    'deposition_simulator': (DepositionSimulator, PANEL | PLACE),
    'model_comparison': (
        ModelComparison,
        PANEL | PLACE | {'measurements_file': str(SAMPLES / 'panel_study/panel_577.csv')},
    ),
    'index_planner': (IndexPlanner, PANEL),
    'bag_player': (BagPlayer, {'bag': str(SAMPLES / 'door_horizontal'), 'start_paused': True}),
    'atomizer_source': (AtomizerSource, {}),
    'egm_source': (EgmSource, {'port': 16510}),
    'opcua_source': (OpcuaSource, {'trigger': 'i=1', 'url': 'opc.tcp://127.0.0.1:9'}),
    'rws_source': (RwsSource, {'trigger': 'doGun', 'url': 'http://127.0.0.1:9'}),
    'run_recorder': (RunRecorder, {'name': 'run'}),
    'web_view': (WebView, PANEL | {'port': 0}),
}
# Where tf2 is installed, and with use_sim_time.
NOT_ALWAYS = {'/tf', '/tf_static', '/clock'}
# By every node's logger, and as it follows the parameters of others.
OF_ALL = {'/rosout', '/parameter_events'}


def allowed(repository, node: str) -> dict[str, set[str]]:
    """Full names that a node may publish, subscribe to, reply on and execute."""
    policies = ElementTree.parse(repository / 'config/sros2/policies.xml')
    (profile,) = policies.findall(f".//profile[@node='{node}']")
    assert profile.get('ns') == '/'
    found = {}
    for kind in ('publish', 'subscribe', 'reply', 'execute'):
        names = profile.findall(f"*[@{kind}='ALLOW']/*")
        texts = [name.text.replace('~', f'/{node}') for name in names]
        found[kind] = {text if text.startswith('/') else f'/{text}' for text in texts}
    return found


@pytest.mark.parametrize('name', NODES)
def test_policies_fit_the_nodes(repository, ros_context, executor, wait_until, tmp_path, name):
    node_class, values = NODES[name]
    if name == 'run_recorder':
        values = values | {'output_directory': str(tmp_path)}
    if name == 'atomizer_source':
        values = values | {'urdf_file': str(URDF)}
    node = node_class(context=ros_context, parameter_overrides=parameters(**values))
    executor.add_node(node)
    rules = allowed(repository, name)
    published = {publisher.topic_name for publisher in node.publishers} | OF_ALL
    if isinstance(node, ManagedNode):
        # By the state machine, which lies below rclpy's publishers.
        published |= {f'/{name}/transition_event'}
    heard = {subscription.topic_name for subscription in node.subscriptions}
    if name == 'run_recorder':
        # It subscribes as publishers appear.
        heard |= {node.resolve_topic_name(topic) for topic in (*default_topics(['']), 'part')}
    if name == 'atomizer_source':
        heard.add('/joint_states')  # likewise
    offered = {service.service_name for service in node.services}
    assert published | NOT_ALWAYS == rules['publish'] | NOT_ALWAYS
    assert heard | NOT_ALWAYS | OF_ALL == rules['subscribe'] | NOT_ALWAYS | OF_ALL
    assert offered | NOT_ALWAYS == rules['reply'] | NOT_ALWAYS

    def executed() -> set[str]:
        return {action for action, _ in get_action_server_names_and_types_by_node(node, name, '/')}

    wait_until(lambda: executed() == rules['execute'], what='the actions of the policies')
