"""The nodes with their parameters, topics, services and actions, as they are when they run."""

import importlib
import json
import math
from functools import partial
from inspect import cleandoc
from tempfile import TemporaryDirectory
from typing import Any

import rclpy
from rclpy.action import get_action_server_names_and_types_by_node
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter

from generated.markdown import definitions, prose, table
from paint_deposition.api.simulation import sample_folder
from paint_deposition.nodes import executables
from paint_deposition.nodes.node import PaintNode
from paint_deposition.nodes.parameters import NodeParameter

# What a node needs to be given before it has its topics, besides a mesh.
MESH = {'mesh_file': 'panel.stl', 'max_edge_length_m': 0.5}
NEEDED = {
    'atomizer_source': {'trigger': '/gun_open'},
    'bag_player': {'bag': 'panel_577', 'state_topic': '/atomizer/state'},
    'model_comparison': {'measurements_file': 'panel_study/panel_577.csv'},
    # On this machine, where nobody answers.
    'egm_source': {'address': '127.0.0.1'},
    'opcua_source': {'trigger': 'ns=2;s=Gun.Open'},
    'rws_source': {'url': 'http://127.0.0.1:9', 'trigger': 'doGun'},
}
# Every node of rclpy has these.
OF_RCLPY = ('/rosout', '/parameter_events')


def text() -> str:
    """A section for each node."""
    context = Context()
    rclpy.init(args=['--ros-args', '--log-level', 'warn'], context=context)
    try:
        return '\n'.join(
            _section(name, run, context)
            for name, run in vars(executables).items()
            if isinstance(run, partial)
        )
    finally:
        context.try_shutdown()


def _section(name: str, run: partial, context: Context) -> str:
    _, place, class_name = run.args
    module = importlib.import_module(f'paint_deposition.nodes.{place}')
    node_class: type[PaintNode] = getattr(module, class_name)
    with TemporaryDirectory() as written:
        needed = NEEDED.get(name, {}) | (
            MESH if MESH.keys() <= node_class.PARAMETERS.keys() else {}
        )
        given = {key: _sample(value) for key, value in needed.items()}
        if 'output_directory' in node_class.PARAMETERS:
            given['output_directory'] = written
        node = node_class(
            context=context,
            parameter_overrides=[Parameter(key, value=value) for key, value in given.items()],
        )
        connections = _connections(node)
        node.close()
        node.destroy_node()
    doc = prose(cleandoc(node_class.__doc__ or ''))
    parameters = ((key, _described(p)) for key, p in node_class.PARAMETERS.items())
    return '\n'.join([
        f'## {name}\n', doc, '',
        table(('', 'name', 'type'), connections),
        f'### Parameters of {name}\n', definitions(parameters),
    ])  # fmt: skip


def _described(parameter: NodeParameter) -> str:
    meaning, _, unit = parameter.description.rstrip(']').rpartition(' [')
    facts = [
        f'default {json.dumps(parameter.default)}' if parameter.default not in ('', []) else '',
        unit.replace('true/false', '').removesuffix('-').removesuffix(', '),
        _range(parameter),
        f'fixed while the node {parameter.fixed_while}' if parameter.fixed_because else '',
    ]
    return f'{meaning}. *{"; ".join(filter(None, facts))}*'


def _sample(value: Any) -> Any:
    file = sample_folder() / str(value)
    return str(file) if file.exists() else value


def _connections(node: Node) -> list[tuple[str, str, str]]:
    """What it publishes, subscribes to and offers, with the types."""
    place = node.get_name(), node.get_namespace()
    kinds = {
        'publishes': node.get_publisher_names_and_types_by_node(*place),
        'subscribes to': node.get_subscriber_names_and_types_by_node(*place),
        'serves': node.get_service_names_and_types_by_node(*place),
        'acts on': get_action_server_names_and_types_by_node(node, *place),
    }
    own = f'/{node.get_name()}/'
    return [
        (verb, f'`{topic.replace(own, "~/").removeprefix("/")}`', _type(types[0]))
        for verb, found in kinds.items()
        for topic, types in found
        if topic not in OF_RCLPY and '/_action/' not in topic
        and not types[0].startswith(('rcl_interfaces/', 'type_description_interfaces/'))
    ]  # fmt: skip


def _type(name: str) -> str:
    """The name of a type; one of ours with a link to what its file says."""
    package, kind, message = name.split('/')
    link = f'(messages.md#{message.lower()}-{kind})' if package == 'paint_msgs' else ''
    return f'[`{name}`]{link}' if link else f'`{name}`'


def _range(parameter: NodeParameter) -> str:
    if parameter.choices:
        return 'one of ' + ', '.join(parameter.choices)
    if parameter.bounds is None:
        return parameter.constraints
    low, high = parameter.bounds
    return f'{low:g} to {high:g}' if math.isfinite(high) else f'{low:g} or more'
