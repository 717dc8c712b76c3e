"""The policies of the nodes allow what the nodes do, and name nothing that is not there."""

from xml.etree import ElementTree

import pytest
from rclpy.action import get_action_server_names_and_types_by_node

from booth import SAMPLES
from nodes.cell import parameters
from paint_deposition.nodes.bags.recorded_topic import default_topics
from paint_deposition.nodes.managed_node import ManagedNode
from robot_arm import URDF
from test_packaging import class_of

PANEL = {'mesh_file': str(SAMPLES / 'panel_study/panel.stl'), 'max_edge_length_m': 0.2}
PLACE = {'part_pose': [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], 'part_parent_frame': 'base'}
READINGS = {'measurements_file': str(SAMPLES / 'panel_study/panel_577.csv')}
# What each node is told.
NODES = {
    'deposition_simulator': PANEL | PLACE,
    'model_comparison': PANEL | PLACE | READINGS,
    'index_planner': PANEL,
    'bag_player': {'bag': str(SAMPLES / 'door_horizontal'), 'start_paused': True},
    'atomizer_source': {'urdf_file': str(URDF)},
    'egm_source': {'port': 16510},
    'opcua_source': {'trigger': 'i=1', 'url': 'opc.tcp://127.0.0.1:9'},
    'rws_source': {'trigger': 'doGun', 'url': 'http://127.0.0.1:9'},
    'run_recorder': {'name': 'run'},
    'web_view': PANEL | {'port': 0},
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
    values = NODES[name]
    if name == 'run_recorder':
        values = values | {'output_directory': str(tmp_path)}
    node = class_of(name)(context=ros_context, parameter_overrides=parameters(**values))
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
