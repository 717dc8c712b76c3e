"""Tables of node parameters, from which they are declared, described and validated."""

import math
import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal, get_args, get_origin

from pydantic import AfterValidator, BaseModel, Field, TypeAdapter, ValidationError
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter

from paint_deposition.errors import PaintError, did_you_mean, quoted
from paint_deposition.film.statistics import DEFAULT_PAINTED_ABOVE_UM, require_band

# By the endings of names.
UNITS = {'_m_per_s': 'm/s', '_m_per_s2': 'm/s2', '_um': 'µm', '_rad': 'rad', '_m': 'm'}
RUNS, CONFIGURED = 'runs', 'is configured'  # `fixed_while`; a node that runs is in any state
# Room is left for what is appended: a date, the number of a coat, the ending of a file.
FILE_NAME = re.compile(r'[A-Za-z0-9_][A-Za-z0-9._-]{0,199}')
FILE_NAME_RULE = (
    "at most 200 letters, digits, '-', '_' and '.', the first a letter, a digit or '_'"
)


@dataclass(frozen=True)
class NodeParameter:
    """One row of a node's parameter table.

    `default` determines the type; a list needs its `element` type (str or float) as well.
    `description` ends with the unit; with `[path]`, a leading `~` of the value is expanded.
    `bounds` are inclusive, and the upper one may be infinite. `allows` (value -> bool) is a
    further check, and `constraints` describes it. `fixed_because` is the reason why the parameter
    cannot change while the node `fixed_while`.
    """

    default: bool | int | float | str | list
    description: str
    bounds: tuple[float, float] | None = None
    choices: tuple[str, ...] = ()
    constraints: str = ''
    allows: Callable[[Any], bool] | None = None
    element: type | None = None
    fixed_because: str = ''
    fixed_while: str = RUNS

    @property
    def is_path(self) -> bool:
        """Whether it names a file or a folder, or several."""
        return self.description.endswith('[path]')

    @property
    def ros_type(self) -> Parameter.Type:
        value = [self.element()] if self.element else self.default
        return Parameter.Type.from_parameter_value(value)

    def descriptor(self) -> ParameterDescriptor:
        texts = ['one of ' + ', '.join(self.choices) if self.choices else self.constraints]
        if self.fixed_because:
            texts.append(f'cannot change while the node {self.fixed_while}: {self.fixed_because}')
        descriptor = ParameterDescriptor(
            type=self.ros_type.value,
            description=self.description,
            additional_constraints='; '.join(filter(None, texts)),
            read_only=bool(self.fixed_because) and self.fixed_while == RUNS,
        )
        low, high = self.bounds or (0, 0)
        if self.bounds and self.ros_type == Parameter.Type.INTEGER:
            most = int(min(high, 2**63 - 1))
            descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=most)]
        elif self.bounds:
            descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
        return descriptor

    def checked(self, name: str, value: Any) -> Any:
        """A value for the parameter of this name, in its type, as requests are checked.

        YAML may have 2 for 2.0, and ROS None for []. Raises PaintError.
        """
        if self.element and not isinstance(value, (str, int, float)):
            value = list(value or [])
        kind: Any = self.element or type(self.default)
        limits: dict[str, Any] = {'strict': True}
        if kind is float:
            limits['allow_inf_nan'] = False
        if self.bounds:
            low, high = self.bounds
            limits |= {'ge': low} | ({'le': high} if math.isfinite(high) else {})
        kind = Literal[self.choices] if self.choices else Annotated[kind, Field(**limits)]
        if self.is_path:
            # No shell expands a leading ~ in parameter files or after :=.
            kind = Annotated[kind, AfterValidator(os.path.expanduser)]
        try:
            value = TypeAdapter(list[kind] if self.element else kind).validate_python(value)
        except ValidationError as error:
            first = error.errors()[0]
            value, remedy = first['input'], first['msg'].removeprefix('Input should be ')
            for long, short in (
                ('greater than or equal to', 'at least'), ('greater than', 'a number above'),
                ('less than or equal to', 'at most'), ('less than', 'a number below'),
            ):  # fmt: skip
                remedy = remedy.replace(long, short)
            shown = f'{value:g}' if isinstance(value, float) else quoted(value)
            raise PaintError(f'{name} is {shown}; give {remedy}') from None
        if self.allows is not None and not self.allows(value):
            raise PaintError(f'{name} is {quoted(value)}; give {self.constraints}')
        return value


ParameterTable = Mapping[str, NodeParameter]


def requested(
    request: type[BaseModel], name: str, default: Any = 0.0, none: str = ''
) -> NodeParameter:
    """The row for a field of a request, described as its option.

    A field that may be left out is 0 for that, and `none` says what is then where its text does
    not.
    """
    field = request.model_fields[name]
    text = str(field.description).rstrip('.')
    if isinstance(default, bool):
        return NodeParameter(default, f'{text.replace("default:", "false:")} [true/false]')
    if isinstance(default, str):
        choices = get_args(field.annotation) if get_origin(field.annotation) is Literal else ()
        return NodeParameter(
            default, f'{text.replace("default:", "empty:")} [name]', None, choices
        )
    unit = next(unit for ending, unit in UNITS.items() if name.endswith(ending))
    text = text.replace(f' [{unit}]', '').replace('default:', '0:')
    low, high = -math.inf, math.inf
    for bound in field.metadata:
        low = getattr(bound, 'ge', getattr(bound, 'gt', low))
        high = getattr(bound, 'le', getattr(bound, 'lt', high))
    low = low if field.default is not None else 0.0
    text += f'; 0: {none}' if none else ''
    bounds = None if (low, high) == (-math.inf, math.inf) else (low, high)
    return NodeParameter(default, f'{text} [{unit}]', bounds)


# The rows that say how a film is shown, and what film is wanted.
DISPLAY: ParameterTable = {
    name: NodeParameter(default, f'{text} [µm]', (0.0, 10_000.0))
    for name, default, text in (
        ('color_min_um', 0.0, 'Film at the lower end of the colours; both ends 0: automatic'),
        ('color_max_um', 0.0, 'Film at the upper end of the colours; both ends 0: automatic'),
        ('painted_above_um', DEFAULT_PAINTED_ABOVE_UM,
         'Thinner film counts, and is shown, as bare metal'),
        ('target_um', 0.0, 'Film wanted; 0: none'),
        ('target_tolerance_um', 0.0, 'Allowed difference from the target'),
    )
}  # fmt: skip


def require_display(values: Mapping[str, Any]) -> None:
    """Raise PaintError where the ends of the colours, or target and tolerance, contradict."""
    low, high = values['color_min_um'], values['color_max_um']
    if (low, high) != (0.0, 0.0) and low >= high:
        raise PaintError(
            f'color_min_um {low:g} is not below color_max_um {high:g}; both 0 is automatic'
        )
    require_band(values['target_um'], values['target_tolerance_um'])


def direction_parameter(description: str) -> NodeParameter:
    """A row for a direction of any length; empty is none."""
    return NodeParameter(
        [],
        description,
        constraints='three numbers that are not all zero, or none',
        allows=lambda value: not value or (len(value) == 3 and any(value)),
        element=float,
    )


def atomizers_parameter(what_they_do: str) -> NodeParameter:
    """A row for the names of several guns; empty: the cell has one gun."""
    name = re.compile(r'[A-Za-z]\w*(/[A-Za-z]\w*)*', re.ASCII)
    return NodeParameter(
        [],
        f'Names of the guns {what_they_do}, which precede their topics, as in '
        'robot_1/atomizer/pose; empty: one gun on atomizer/pose [names]',
        constraints='different names of letters, digits, _ and /, such as robot_1',
        allows=lambda names: (
            not names or (len(set(names)) == len(names) and all(map(name.fullmatch, names)))
        ),
        element=str,
    )


def mesh_parameters(max_edge_length_m: float) -> ParameterTable:
    """The rows that describe a part's mesh, with this default for `max_edge_length_m`."""
    return {
        'mesh_file': NodeParameter('', "The part's mesh: STL, PLY, OBJ, glTF or STEP [path]"),
        'mesh_scale': NodeParameter(
            1.0, 'Metres for one unit of the mesh file; 0.001 for a mesh in mm [m]', (1e-9, 1e3)
        ),
        'max_edge_length_m': NodeParameter(
            max_edge_length_m, 'Triangles are split until no edge is longer [m]', (1e-4, 10.0)
        ),
        'frame_id': NodeParameter(
            'part',
            'Frame of the mesh and of the messages about it [name]',
            constraints='a name',
            allows=lambda value: bool(value.strip('/')),
        ),
        'input_folders': NodeParameter(
            [],
            'Folders whose meshes, models and recordings may be asked for later, beside those of '
            'the files named at the start [path]',
            element=str,
            fixed_because='whoever can set parameters could otherwise read files of this machine; '
            'restart the node with the new value',
        ),
    }


def fixed(because: str, fixed_while: str = RUNS, /, **rows: NodeParameter) -> ParameterTable:
    """The rows, fixed for this reason while the node runs, or `CONFIGURED`."""
    return {
        name: replace(row, fixed_because=because, fixed_while=fixed_while)
        for name, row in rows.items()
    }


def declare_parameters(node: Node, table: ParameterTable) -> dict[str, Any]:
    """Declare every row on `node`, and return the values.

    Raises PaintError for an override that is invalid or that no row has; it names the nearest.
    """
    # rclpy has no public access to overrides that are not declared, such as misspelt names.
    overrides = {name: parameter.value for name, parameter in node._parameter_overrides.items()}
    of_rclpy = {'use_sim_time', 'start_type_description_service'}
    for name in overrides.keys() - table.keys() - of_rclpy:
        remedy = did_you_mean(name, table)
        raise PaintError(f'{node.get_name()} has no parameter {name}; {remedy}')
    for name, row in table.items():
        try:
            value = row.checked(name, overrides.get(name, row.default))
        except PaintError as error:
            raise PaintError(f'{node.get_name()}: {error}') from None
        if value != []:
            node.declare_parameter(name, value, row.descriptor(), ignore_override=True)
            continue
        # rclpy takes an empty list for bytes unless the type is declared before the value is set.
        writable = row.descriptor()
        writable.read_only = False
        node.declare_parameter(name, row.ros_type, writable, ignore_override=True)
        Node.set_parameters(node, [Parameter(name, row.ros_type, [])])
        node.set_descriptor(name, row.descriptor())
    return {name: node.get_parameter(name).value for name in table}


def require_file_name(what: str, name: str) -> None:
    """Raise PaintError for a name that is empty or could lead to another folder."""
    if not FILE_NAME.fullmatch(name):
        raise PaintError(f'{what} {quoted(name)}: use {FILE_NAME_RULE}')
