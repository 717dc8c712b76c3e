"""A paint cell: the live film and the index planner; a bag, a recording, a comparison on request.

ros2 launch paint_deposition paint_cell.launch.py
ros2 launch paint_deposition paint_cell.launch.py bag:=run_1 record:=runs
ros2 launch paint_deposition paint_cell.launch.py --show-args
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import (
    LaunchConfiguration,
    NotEqualsSubstitution,
    PathJoinSubstitution,
    PythonExpression,
)
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

PACKAGE = 'paint_deposition'


def shared(*path):
    return PathJoinSubstitution([FindPackageShare(PACKAGE), *path])


def text(argument):
    """Take a launch argument as text, also where it looks like a number."""
    return ParameterValue(LaunchConfiguration(argument), value_type=str)


def given(argument):
    return IfCondition(NotEqualsSubstitution(LaunchConfiguration(argument), ''))


def count_with(*arguments):
    """One for the simulator, and one for each of these launch arguments that is given."""
    expression = ['1']
    for argument in arguments:
        is_given = NotEqualsSubstitution(LaunchConfiguration(argument), '')
        expression += [" + ('", is_given, "'.lower() == 'true')"]
    return PythonExpression(expression)


def cell_node(name, parameters=None, condition=None):
    """Describe one node: the parameter file first, then what the arguments say."""
    use_sim_time = ParameterValue(LaunchConfiguration('use_sim_time'), value_type=bool)
    return Node(
        package=PACKAGE,
        executable=name,
        name=name,
        namespace=LaunchConfiguration('namespace'),
        parameters=[
            LaunchConfiguration('parameters'),
            {'use_sim_time': use_sim_time, **(parameters or {})},
        ],
        condition=condition,
        output='screen',
    )


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
            description='Run the Python code of effect files that a model names [true/false]',
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
            'trigger',
            default_value='',
            description='What opens the gun, with urdf: /gun, or "/io.level > 12" [topic]',
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
            default_value=count_with('record', 'measurements'),
            description='Nodes that take the poses and must be there before the replay; '
            'as many as are started here [count]',
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
            description='Take time from /clock, which a replayed bag publishes [true/false]',
        ),
    ]
    mesh, model_file = {'mesh_file': text('mesh')}, {'model_file': text('model')}
    model = model_file | {
        'allow_user_effects': ParameterValue(
            LaunchConfiguration('allow_user_effects'), value_type=bool
        )
    }
    replay = {
        'bag': text('bag'),
        'pose_topic': text('pose_topic'),
        'state_topic': text('state_topic'),
        'rate': ParameterValue(LaunchConfiguration('rate'), value_type=float),
        'wait_for_subscribers': ParameterValue(
            LaunchConfiguration('wait_for_subscribers'), value_type=int
        ),
    }
    robot = {
        'urdf_file': text('urdf'),
        'joint_topic': text('joint_topic'),
        'trigger': text('trigger'),
    }
    nodes = [
        cell_node('atomizer_source', robot, given('urdf')),
        cell_node('deposition_simulator', mesh | model),
        cell_node('index_planner', model),
        cell_node('bag_player', replay, given('bag')),
        cell_node(
            'run_recorder',
            mesh | model_file | {'output_directory': text('record')},
            given('record'),
        ),
        cell_node(
            'model_comparison',
            mesh | model | {'measurements_file': text('measurements')},
            given('measurements'),
        ),
    ]
    return LaunchDescription(arguments + nodes)
