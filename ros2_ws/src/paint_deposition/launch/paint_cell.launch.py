"""A paint cell: simulator and index planner; optionally player, recorder, comparison and page.

ros2 launch paint_deposition paint_cell.launch.py
ros2 launch paint_deposition paint_cell.launch.py bag:=run_1 record:=runs
ros2 launch paint_deposition paint_cell.launch.py --show-args

If a node fails, all others are stopped and the launch ends with an error.
"""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

PACKAGE = 'paint_deposition'
SWITCH = ['true', 'false']


def shared(*path):
    return PathJoinSubstitution([FindPackageShare(PACKAGE), *path])


# Name, default and description; a default of 'true' or 'false' is a switch.
ARGUMENTS = (
    (
        'mesh',
        shared('samples', 'door.stl'),
        "The part's mesh: STL, PLY, OBJ, glTF, 3MF or STEP [path]",
    ),
    ('model', '', 'Deposition model, model.yaml; empty: a 50 mm bell [path]'),
    ('allow_user_effects', 'false', 'Run the Python code of effect files that a model names'),
    ('urdf', '', 'Robot whose joint states give the poses; empty: none [path]'),
    ('joint_topic', 'joint_states', "The robot's joint states, with urdf [topic]"),
    ('base_frame', '', 'Frame in which tf gives the poses of tip_frame; empty: none [name]'),
    (
        'tip_frame',
        '',
        "Frame that carries the gun, with base_frame; empty: tool0. The TCP's offset in it is "
        'tcp_offset of the parameter file [name]',
    ),
    (
        'trigger',
        '',
        'Signal that opens the gun: /gun, or "/io.level > 12"; alone, or with urdf or base_frame '
        '[topic]',
    ),
    ('bag', '', 'Bag to replay into the cell; empty: poses come from the robot [path]'),
    ('pose_topic', '', "PoseStamped topic in the bag; empty: the bag's only one [topic]"),
    (
        'state_topic',
        '',
        'Gun trigger in the bag; empty: spraying whenever poses flow [topic]',
    ),
    ('rate', '1.0', 'Speed of the replay; 0: as fast as the nodes take poses [-]'),
    ('publish_clock', 'true', 'Publish the time of the bag on /clock, which all cells share'),
    ('record', '', 'Folder to record the run in; empty: no recording [path]'),
    ('measurements', '', 'Gauge readings to compare with, CSV; empty: no comparison [path]'),
    ('page', 'false', 'Show the film on a page for browsers'),
    # A node that is still loading when the replay starts would miss its first poses.
    (
        'wait_for_subscribers',
        '',
        'Subscribers of the poses to wait for before the replay; empty: as many as are started '
        'here [count]',
    ),
    (
        'parameters',
        shared('config', 'cell.yaml'),
        'Parameters of all nodes, which the arguments above override [path]',
    ),
    ('namespace', '', 'Namespace of the cell; topic names are relative to it'),
    ('use_sim_time', 'false', 'Take time from /clock, which a replayed bag publishes'),
)


def generate_launch_description():
    arguments = [
        DeclareLaunchArgument(
            name,
            default_value=default,
            description=description,
            choices=SWITCH if default in SWITCH else None,
        )
        for name, default, description in ARGUMENTS
    ]
    # All arguments are checked before the first node starts, so that none is left running.
    return LaunchDescription([*arguments, OpaqueFunction(function=cell)])


def cell(context):
    """The nodes that the arguments ask for."""
    given = context.launch_configurations
    parameters = node_parameters(given)
    return [cell_node(given, name, values) for name, values in parameters.items()]


def node_parameters(given):
    """The parameters of each node that is started, by its name, from the arguments."""
    if not Path(given['parameters']).is_file():
        raise ValueError(f'parameters: there is no file {given["parameters"]}')
    if given['urdf'] and given['base_frame']:
        raise ValueError('urdf and base_frame are given: the poses come from joints or from tf')
    if given['tip_frame'] and not given['base_frame']:
        raise ValueError('tip_frame is given without base_frame: name the frame of the poses')
    if given['trigger'] and given['bag']:
        raise ValueError('trigger and bag are given: state_topic names the trigger in a bag')
    mesh, model_file = {'mesh_file': given['mesh']}, {'model_file': given['model']}
    model = model_file | {'allow_user_effects': switched(given, 'allow_user_effects')}
    page = switched(given, 'page')
    replay = {
        'bag': given['bag'],
        'pose_topic': given['pose_topic'],
        'state_topic': given['state_topic'],
        'rate': number(given, 'rate', float),
        'publish_clock': switched(given, 'publish_clock'),
        'wait_for_subscribers': number(given, 'wait_for_subscribers', int)
        if given['wait_for_subscribers']
        else 1 + sum((bool(given['record']), bool(given['measurements']), page)),
    }
    nodes = {'deposition_simulator': mesh | model, 'index_planner': mesh | model}
    if given['urdf']:
        nodes['atomizer_source'] = {
            'urdf_file': given['urdf'],
            'joint_topic': given['joint_topic'],
            'trigger': given['trigger'],
        }
    elif given['base_frame']:
        nodes['atomizer_source'] = {
            'base_link': given['base_frame'],
            'tip_link': given['tip_frame'],
            'trigger': given['trigger'],
        }
    elif given['trigger']:
        nodes['atomizer_source'] = {'trigger': given['trigger']}
    if given['bag']:
        nodes['bag_player'] = replay
    if given['record']:
        nodes['run_recorder'] = mesh | model_file | {'output_directory': given['record']}
    if given['measurements']:
        nodes['model_comparison'] = mesh | model | {'measurements_file': given['measurements']}
    if page:
        nodes['web_view'] = mesh
    return nodes


def cell_node(given, name, parameters):
    """The launch action of a node; the arguments override the parameter file."""

    def ended(event, context):
        if event.returncode and not context.is_shutdown:
            # An exception is what makes a launch end, and end with an error.
            raise RuntimeError(
                f'{name} ended with exit code {event.returncode}; see its last line'
            )

    # Text stays text, also where it looks like a number.
    arguments = {
        key: ParameterValue(value, value_type=str) if isinstance(value, str) else value
        for key, value in parameters.items()
    }
    return Node(
        package=PACKAGE,
        executable=name,
        name=name,
        namespace=given['namespace'],
        parameters=[
            given['parameters'],
            arguments | {'use_sim_time': switched(given, 'use_sim_time')},
        ],
        output='screen',
        on_exit=ended,
    )


def switched(given, argument):
    return given[argument] == 'true'


def number(given, argument, kind):
    try:
        return kind(given[argument])
    except ValueError:
        raise ValueError(f"{argument}: '{given[argument]}' is no number") from None
