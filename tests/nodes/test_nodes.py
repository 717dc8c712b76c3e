"""What all nodes share: tables of parameters, diagnostics, and a coloured mesh."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import Point
from rcl_interfaces.msg import ParameterType
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from booth import SAMPLES
from nodes.cell import parameters
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.effects.library.sag import Sag
from paint_deposition.errors import PaintError
from paint_deposition.files.model_file import write_model
from paint_deposition.nodes.node import OK, WARN, PaintNode, Status
from paint_deposition.nodes.parameters import NodeParameter
from paint_deposition.nodes.topics import coloured_mesh, header, white_marker
from paint_deposition.report.colour_scales import FILM_PALETTE
from refusals import refusal
from robot_arm import URDF
from test_packaging import NODES, class_of, table_of

TABLE = {
    'rate_hz': NodeParameter(2.0, 'Rate [Hz]', (0.1, 100.0)),
    'target_um': NodeParameter(0.0, 'Target film, 0: none [um]', (0.0, math.inf)),
    'queue_depth': NodeParameter(500, 'Queue [messages]', (1, math.inf)),
    'mesh_file': NodeParameter('', 'Mesh [path]', fixed_because='it is read once'),
    'model_file': NodeParameter('', 'Model [path]'),
    'compression': NodeParameter('zstd', 'Compression [name]', choices=('zstd', 'none')),
    'topics': NodeParameter([], 'Topics [names]', element=str, fixed_because='of the run'),
    'down': NodeParameter([0.0, 0.0, -1.0], 'Gravity [1]', element=float),
    'odd': NodeParameter(
        1, 'Odd number [1]', constraints='an odd number', allows=lambda value: value % 2
    ),
}


@pytest.fixture
def declared(ros_context, executor):
    """`declared(name=value, ...)`: a node with the table under these overrides, and its values."""

    class Tester(PaintNode):
        NAME, PARAMETERS = 'tester', TABLE

    def declared(**overrides):
        node = Tester(context=ros_context, parameter_overrides=parameters(**overrides))
        executor.add_node(node)
        return node, dict(node.values)

    return declared


def test_defaults_keep_their_types(declared):
    node, values = declared(use_sim_time=False)
    assert values == {name: row.default for name, row in TABLE.items()}
    described = {name: node.describe_parameter(name) for name in values}
    assert described['rate_hz'].type == ParameterType.PARAMETER_DOUBLE
    assert described['queue_depth'].type == ParameterType.PARAMETER_INTEGER
    assert described['topics'].type == ParameterType.PARAMETER_STRING_ARRAY
    assert described['down'].type == ParameterType.PARAMETER_DOUBLE_ARRAY
    assert described['rate_hz'].description == 'Rate [Hz]'
    (bounds,) = described['rate_hz'].floating_point_range
    assert (bounds.from_value, bounds.to_value) == (0.1, 100.0)
    assert described['odd'].additional_constraints == 'an odd number'
    assert described['compression'].additional_constraints == 'one of zstd, none'


def test_the_line_for_a_wrong_override(declared):
    for overrides, line in (
        ({'rate_hz': 200.0}, 'tester: rate_hz is 200; give at most 100'),
        ({'queue_depth': 0}, 'tester: queue_depth is 0; give at least 1'),
        ({'rate_hz': float('nan')}, 'tester: rate_hz is nan; give a finite number'),
        ({'rate_hz': 'fast'}, "tester: rate_hz is 'fast'; give a valid number"),
        ({'queue_depth': 2.5}, 'tester: queue_depth is 2.5; give a valid integer'),
        ({'mesh_file': 7}, 'tester: mesh_file is 7; give a valid string'),
        ({'topics': [1, 2]}, 'tester: topics is 1; give a valid string'),
        ({'compression': 'zip'}, "tester: compression is 'zip'; give 'zstd' or 'none'"),
        ({'odd': 2}, 'tester: odd is 2; give an odd number'),
        ({'mesh_fil': 'x'}, "tester has no parameter mesh_fil; did you mean 'mesh_file'?"),
        ({'speed': 1.0}, 'tester has no parameter speed; '),
        ({'qos_overrides./tf.publisher.depth': 3}, 'tester has no parameter qos_overrides./tf'),
    ):
        assert refusal(PaintError, declared, **overrides).startswith(line)


def test_later_changes_are_checked_too(declared):
    node, values = declared()
    for name, value, reason in (
        ('rate_hz', 1e3, 'out of range'),
        ('rate_hz', float('nan'), 'rate_hz'),
        ('compression', 'zip', "give 'zstd' or 'none'"),
        ('odd', 4, 'give an odd number'),
        ('mesh_file', 'other.stl', 'cannot change while the node runs: it is read once'),
        ('topics', ['a'], 'cannot change while the node runs: of the run'),
        ('queue_depth', 'deep', 'Wrong parameter type'),
    ):
        (result,) = node.set_parameters(parameters(**{name: value}))
        assert not result.successful
        assert reason in result.reason
        assert node.get_parameter(name).value == values[name]
    # A whole number is a number.
    assert node.set_parameters(parameters(rate_hz=5))[0].successful
    assert node.get_parameter('rate_hz').value == 5.0


def test_a_home_folder_is_found_at_the_start_and_later(declared, monkeypatch, tmp_path):
    monkeypatch.setenv('HOME', str(tmp_path))
    node, values = declared(mesh_file='~/door.stl', model_file='models~/a.yaml')
    assert values['mesh_file'] == node.get_parameter('mesh_file').value == f'{tmp_path}/door.stl'
    assert values['model_file'] == 'models~/a.yaml'
    assert node.set_parameters(parameters(model_file='~/b.yaml'))[0].successful
    assert node.get_parameter('model_file').value == f'{tmp_path}/b.yaml'
    (result,) = node.set_parameters(parameters(model_file=7))
    assert 'Wrong parameter type' in result.reason


PART = {'mesh_file': str(SAMPLES / 'panel_study/panel.stl'), 'max_edge_length_m': 0.2}
READINGS = PART | {'measurements_file': str(SAMPLES / 'panel_study/panel_577.csv')}
BAG = str(SAMPLES / 'door_horizontal')
GUNS = PART | {'atomizers': ['left', 'right']}
REFUSED = {
    'atomizer_source': [
        ({}, 'urdf_file and base_link are empty: give the robot, or the frame'),
        ({'urdf_file': 'nowhere.urdf'}, 'cannot read nowhere.urdf'),
        ({'urdf_file': str(URDF), 'flow': '/flow'}, 'flow is given without a trigger'),
        ({'urdf_file': str(URDF), 'trigger': '/io > many'}, "is '/io > many': give a topic"),
        ({'urdf_file': str(URDF), 'tip_link': 'bell'}, "no link 'bell'"),
    ],
    'bag_player': [
        ({'bag': ''}, 'bag is empty: give the path of a recording'),
        ({'bag': '/nowhere'}, '/nowhere: no such file; give a bag'),
        ({'bag': BAG, 'pose_topic': 'atomizer/pos'}, 'its PoseStamped topics: /atomizer/pose'),
        ({'bag': BAG, 'state_topic': '/gun'}, 'its state topics: /atomizer/state'),
    ],
    'deposition_simulator': [
        (GUNS | {'model_files': ['thin.yaml']}, 'names 1 models for 2 atomizers: give'),
        (GUNS | {'model_files': 2 * ['thin.yaml'], 'model_file': 'thin.yaml'},
         'atomizers and model_file another: give model_file'),
        (GUNS | {'model_files': ['thin.yaml', 'sagging.yaml']},
         r'left and right differ in what acts on the finished film.*\(sag\)'),
        (GUNS | {'atomizers': ['left', 'left']}, 'atomizers is .*give different names'),
        (GUNS | {'atomizers': ['../robot']}, 'atomizers is .*give different names'),
    ],
    'model_comparison': [
        (READINGS | {'measurements_file': ''}, 'measurements_file is empty'),
        (READINGS | {'measurements_file': 'nowhere.csv'}, 'nowhere.csv: no such file'),
        (READINGS | {'mesh_file': ''}, 'mesh_file is empty'),
        (READINGS | {'mesh_scale': 0.01}, "lie off the part's surface"),
    ],
    'run_recorder': [
        ({'mesh_file': '/nowhere.stl'}, 'mesh_file /nowhere.stl: No such file or directory'),
        ({'model_file': 'loop/model.yaml'}, 'model_file loop/model.yaml: .*symbolic links'),
        ({'output_directory': '/dev/null/runs', 'name': 'run'},
         'cannot create /dev/null/runs/run'),
    ],
    'rws_source': [
        ({}, 'trigger is empty'),
        ({'trigger': 'a', 'flow': 'a'}, 'a signal is named twice: a a'),
        ({'trigger': 'a', 'url': 'http://me:secret@127.0.0.1:9'}, 'url holds a login, .*RWS_PASS'),
    ],
}  # fmt: skip


@pytest.mark.parametrize('node', REFUSED)
def test_what_a_node_cannot_start_with_is_refused_in_a_line(node, start, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path('loop').symlink_to('loop')
    write_model('thin.yaml', DepositionModel())
    write_model('sagging.yaml', DepositionModel(effects=(Sag.typical(),)))
    for values, words in REFUSED[node]:
        line = refusal(PaintError, start, class_of(node), **values)
        assert re.search(words, line), line
        assert 'secret' not in line


@pytest.mark.parametrize('node', NODES)
def test_every_description_states_a_unit_and_every_fixed_one_why(node):
    for name, row in table_of(node).items():
        assert row.description.endswith(']'), name
        assert row.checked(name, row.default) == row.default, name
        assert len(row.fixed_because) > 20 or node not in ('bag_player', 'run_recorder'), name


# Names of every length modulo 8: what comes behind them must keep its alignment.
@pytest.mark.parametrize('frame_id', ['', 'p', 'pa', 'par', 'part', 'cell1/door', 'Tür'])
@pytest.mark.parametrize('triangles', [1, 2, 57])
def test_the_mesh_is_the_marker_that_rclpy_builds(frame_id, triangles):
    rng = np.random.default_rng(7)
    vertices, faces = rng.normal(size=(40, 3)), rng.integers(0, 40, size=(triangles, 3))
    mesh = coloured_mesh(vertices, faces, frame_id, 'thickness')
    for stamp_ns in (0, 1_758_000_123_456_789_012):
        rows = rng.integers(0, len(FILM_PALETTE), size=len(vertices))
        data = mesh(stamp_ns, FILM_PALETTE, rows)
        expected = white_marker(Marker.TRIANGLE_LIST, 'thickness', 0, frame_id)
        expected.header = header(frame_id, stamp_ns)
        rgba = FILM_PALETTE[rows] / 255.0
        for vertex in faces.ravel():
            x, y, z = vertices[vertex].tolist()
            r, g, b, a = rgba[vertex].tolist()
            expected.points.append(Point(x=x, y=y, z=z))
            expected.colors.append(ColorRGBA(r=r, g=g, b=b, a=a))
        received = deserialize_message(data, Marker)
        assert received.points == expected.points
        for name in 'rgba':
            colours = [[getattr(c, name) for c in m.colors] for m in (received, expected)]
            assert np.allclose(*colours, rtol=0, atol=1e-7)
        expected.colors = received.colors
        assert received == expected
        # Padding may hold anything; there is none behind the header's name.
        assert len(data) == len(serialize_message(expected))


def test_every_task_reports_each_period(ros_context, spin, onlooker, wait_until):
    node = PaintNode(context=ros_context, namespace='cell1')
    calls = []

    def gun() -> Status:
        calls.append(1)
        return WARN, f'call {len(calls)}', {'poses': 3, 'gap s': 0.5}

    node.report({'gun': gun, 'mesh': lambda: (OK, 'loaded', {})}, period_s=0.05)
    viewer = onlooker()
    spin(node)
    wait_until(lambda: len(viewer.heard['/diagnostics']) >= 3, what='diagnostics')
    first, later = (viewer.decoded('/diagnostics', row) for row in (0, 2))
    (gun_status, mesh_status), later_status = first.status, later.status[0]
    assert gun_status.name == 'cell1/paint_node: gun'
    assert mesh_status.name == 'cell1/paint_node: mesh'
    assert (gun_status.level, mesh_status.level) == (b'\x01', b'\x00')
    assert gun_status.hardware_id == '/cell1/paint_node'
    assert [(v.key, v.value) for v in gun_status.values] == [('poses', '3'), ('gap s', '0.5')]
    assert first.header.stamp.sec > 0
    assert later_status.message != gun_status.message
