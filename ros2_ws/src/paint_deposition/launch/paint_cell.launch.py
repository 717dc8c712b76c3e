"""A paint cell: the live film and the index planner; a bag, a recording, a comparison on request.

ros2 launch paint_deposition paint_cell.launch.py
ros2 launch paint_deposition paint_cell.launch.py bag:=run_1 record:=runs
ros2 launch paint_deposition paint_cell.launch.py --show-args

A node that fails ends the cell, and the launch with an error.
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


def generate_launch_description():
    arguments = [
        DeclareLaunchArgument(
            'mesh',
            default_value=shared('samples', 'door.stl'),
            description="The part's mesh: STL, PLY, OBJ, glTF, 3MF or STEP [path]",
        ),
        DeclareLaunchArgument(
            'model',
            default_value='',
            description='Deposition model, model.yaml; empty: a 50 mm bell [path]',
        ),
        DeclareLaunchArgument(
            'allow_user_effects',
            default_value='false',
            choices=SWITCH,
            description='Run the Python code of effect files that a model names',
        ),
        DeclareLaunchArgument(
            'urdf',
            default_value='',
            description='Robot whose joint states give the poses; empty: none [path]',
        ),
        DeclareLaunchArgument(
            'joint_topic',
            default_value='joint_states',
            description="The robot's joint states, with urdf [topic]",
        ),
        DeclareLaunchArgument(
            'base_frame',
            default_value='',
            description='Frame in which tf gives the poses of tip_frame; empty: none [name]',
        ),
        DeclareLaunchArgument(
            'tip_frame',
            default_value='',
            description="Frame that carries the gun, with base_frame; empty: tool0. The TCP's "
            'offset in it is tcp_offset of the parameter file [name]',
        ),
        DeclareLaunchArgument(
            'trigger',
            default_value='',
            description='What opens the gun, with urdf or base_frame: /gun, or "/io.level > 12" '
            '[topic]',
        ),
        DeclareLaunchArgument(
            'bag',
            default_value='',
            description='Bag to replay into the cell; empty: poses come from the robot [path]',
        ),
        DeclareLaunchArgument(
            'pose_topic',
            default_value='',
            description="PoseStamped topic in the bag; empty: the bag's only one [topic]",
        ),
        DeclareLaunchArgument(
            'state_topic',
            default_value='',
            description='Gun trigger in the bag; empty: spraying whenever poses flow [topic]',
        ),
        DeclareLaunchArgument(
            'rate',
            default_value='1.0',
            description='Speed of the replay; 0: as fast as the nodes take poses [-]',
        ),
        DeclareLaunchArgument(
            'publish_clock',
            default_value='true',
            choices=SWITCH,
            description='Publish the time of the bag on /clock, which all cells share',
        ),
        DeclareLaunchArgument(
            'record',
            default_value='',
            description='Folder to record the run in; empty: no recording [path]',
        ),
        DeclareLaunchArgument(
            'measurements',
            default_value='',
            description='Gauge readings to compare with, CSV; empty: no comparison [path]',
        ),
        # A node that is still loading when the replay starts would miss its first poses.
        DeclareLaunchArgument(
            'wait_for_subscribers',
            default_value='',
            description='Nodes that take the poses and must be there before the replay; '
            'empty: as many as are started here [count]',
        ),
        DeclareLaunchArgument(
            'parameters',
            default_value=shared('config', 'cell.yaml'),
            description='Parameters of all nodes; the arguments above go first [path]',
        ),
        DeclareLaunchArgument(
            'namespace',
            default_value='',
            description='Namespace of the cell; topic names are relative to it',
        ),
        DeclareLaunchArgument(
            'use_sim_time',
            default_value='false',
            choices=SWITCH,
            description='Take time from /clock, which a replayed bag publishes',
        ),
    ]
    # All is checked before the first node starts: one that fails later would leave the others.
    return LaunchDescription([*arguments, OpaqueFunction(function=cell)])


def cell(context):
    """The nodes that the arguments ask for."""
    given = context.launch_configurations
    return [cell_node(given, name, parameters) for name, parameters in wanted(given).items()]


def wanted(given):
    """The parameters that the arguments tell of each node, by its name."""
    if not Path(given['parameters']).is_file():
        raise ValueError(f'parameters: there is no file {given["parameters"]}')
    if given['urdf'] and given['base_frame']:
        raise ValueError('urdf and base_frame are given: the poses come from joints or from tf')
    if given['tip_frame'] and not given['base_frame']:
        raise ValueError('tip_frame is given without base_frame: name the frame of the poses')
    if given['trigger'] and not (given['urdf'] or given['base_frame']):
        raise ValueError('trigger is given without urdf or base_frame, with which it goes')
    mesh, model_file = {'mesh_file': given['mesh']}, {'model_file': given['model']}
    model = model_file | {'allow_user_effects': switched(given, 'allow_user_effects')}
    replay = {
        'bag': given['bag'],
        'pose_topic': given['pose_topic'],
        'state_topic': given['state_topic'],
        'rate': number(given, 'rate', float),
        'publish_clock': switched(given, 'publish_clock'),
        'wait_for_subscribers': number(given, 'wait_for_subscribers', int)
        if given['wait_for_subscribers']
        else 1 + bool(given['record']) + bool(given['measurements']),
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
    if given['bag']:
        nodes['bag_player'] = replay
    if given['record']:
        nodes['run_recorder'] = mesh | model_file | {'output_directory': given['record']}
    if given['measurements']:
        nodes['model_comparison'] = mesh | model | {'measurements_file': given['measurements']}
    return nodes


def cell_node(given, name, parameters):
    """Describe one node: the parameter file first, then what the arguments say."""

    def ended(event, context):
        if event.returncode and not context.is_shutdown:
            # An exception is what makes a launch end, and end with an error.
            raise RuntimeError(
                f'{name} ended with exit code {event.returncode}; see its last line'
            )

    # Text stays text, also where it looks like a number.
    told = {
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
            told | {'use_sim_time': switched(given, 'use_sim_time')},
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
