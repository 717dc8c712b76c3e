"""A paint cell: simulator and index planner; optionally player, recorder, comparison and page.

ros2 launch paint_deposition paint_cell.launch.py
ros2 launch paint_deposition paint_cell.launch.py bag:=run_1 record:=runs
ros2 launch paint_deposition paint_cell.launch.py --show-args

If a node fails, all others are stopped and the launch ends with an error.
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

PACKAGE = 'paint_deposition'
SHARE = Path(get_package_share_directory(PACKAGE))
PARAMETERS = str(SHARE / 'config' / 'cell.yaml')
SWITCH = ['true', 'false']
SWITCHES = ('allow_user_effects', 'publish_clock', 'page', 'use_sim_time')

# Name, default and description. What is empty is left to the parameter file.
ARGUMENTS = (
    (
        'mesh',
        '',
        "The part's mesh: STL, PLY, OBJ, glTF or STEP; empty: that of the parameter file, or "
        'the sample door without a file of your own [path]',
    ),
    ('model', '', 'Deposition model, model.yaml [path]'),
    ('allow_user_effects', '', 'Run the Python code of effect files that a model names'),
    (
        'urdf',
        '',
        'Robot whose joint states, of the bag if there is one, give the poses; empty: none [path]',
    ),
    ('joint_topic', '', "The robot's joint states, with urdf and no bag [topic]"),
    (
        'base_frame',
        '',
        'Frame in which tf, of the bag if there is one, gives the poses of tip_frame; empty: none '
        '[name]',
    ),
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
    ('pose_topic', '', 'PoseStamped topic in the bag [topic]'),
    ('state_topic', '', 'Gun trigger in the bag [topic]'),
    ('rate', '', 'Speed of the replay; 0: as fast as the nodes take poses [-]'),
    ('publish_clock', '', 'Publish the time of the bag on /clock, which all cells share'),
    ('record', '', 'Folder to record the run in; empty: no recording [path]'),
    ('measurements', '', 'Gauge readings to compare with, CSV; empty: no comparison [path]'),
    ('page', 'false', 'Show the film on a page for browsers'),
    # A node that is still loading when the replay starts would miss its first poses.
    (
        'wait_for_subscribers',
        '',
        'Subscribers of the poses to wait for before the replay; empty: as many as are started '
        'here, which the parameter file cannot know [count]',
    ),
    ('parameters', PARAMETERS, 'Parameters of all nodes; arguments that are given override them'),
    ('namespace', '', 'Namespace of the cell; topic names are relative to it'),
    ('use_sim_time', '', 'Take time from /clock, which a replayed bag publishes'),
)


def generate_launch_description():
    arguments = [
        DeclareLaunchArgument(
            name,
            default_value=default,
            description=description,
            choices=[*SWITCH, default] if name in SWITCHES else None,
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
    if given['joint_topic'] and given['bag']:
        raise ValueError('joint_topic and bag are given: the bag has the joint states')
    mesh, page = given['mesh'], given['page'] == 'true'
    if not mesh and given['parameters'] == PARAMETERS:
        mesh = str(SHARE / 'samples' / 'door.stl')
    part = said(mesh_file=mesh)
    model_file = said(model_file=given['model'])
    painting = part | model_file | switches(given, 'allow_user_effects')
    nodes = {'deposition_simulator': painting, 'index_planner': painting}
    if given['bag']:
        listeners = 1 + sum((bool(given['record']), bool(given['measurements']), page))
        names = 'bag', 'pose_topic', 'state_topic', 'urdf'
        nodes['bag_player'] = said(**{name: given[name] for name in names})
        nodes['bag_player'] |= switches(given, 'publish_clock') | said(
            tf=given['base_frame'] and [given['base_frame'], given['tip_frame'] or 'tool0'],
            rate=number(given, 'rate', float),
        )
        waited_for = number(given, 'wait_for_subscribers', int)
        nodes['bag_player']['wait_for_subscribers'] = listeners if waited_for == '' else waited_for
    elif given['urdf'] or given['base_frame'] or given['trigger']:
        nodes['atomizer_source'] = said(
            urdf_file=given['urdf'],
            joint_topic=given['joint_topic'],
            base_link=given['base_frame'],
            tip_link=given['tip_frame'],
            trigger=given['trigger'],
        )
    if given['record']:
        nodes['run_recorder'] = part | model_file | {'output_directory': given['record']}
    if given['measurements']:
        nodes['model_comparison'] = painting | {'measurements_file': given['measurements']}
    if page:
        nodes['web_view'] = part
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
        for key, value in (parameters | switches(given, 'use_sim_time')).items()
    }
    return Node(
        package=PACKAGE,
        executable=name,
        name=name,
        namespace=given['namespace'],
        parameters=[given['parameters'], *([arguments] if arguments else [])],
        output='screen',
        on_exit=ended,
    )


def said(**values):
    """The values that are not empty; the others are left to the parameter file."""
    return {name: value for name, value in values.items() if value != ''}


def switches(given, name):
    """A switch as a parameter of the same name, unless it is empty."""
    return {name: given[name] == 'true'} if given[name] else {}


def number(given, argument, kind):
    """The number in an argument, '' where it is empty."""
    try:
        return given[argument] and kind(given[argument])
    except ValueError:
        raise ValueError(f"{argument}: '{given[argument]}' is no number") from None
