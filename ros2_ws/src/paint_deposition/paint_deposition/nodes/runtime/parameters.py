"""A node's parameters as one table: declared, described and validated from it alone."""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.parameter import Parameter

from paint_deposition.errors import PaintError, did_you_mean

INT64_MAX = 2**63 - 1
# What rclpy itself declares, or reads while it makes publishers and subscriptions.
RESERVED_NAMES = frozenset({'use_sim_time', 'start_type_description_service'})
RESERVED_PREFIX = 'qos_overrides.'
TYPE_WORDS = {
    Parameter.Type.BOOL: 'true or false',
    Parameter.Type.INTEGER: 'a whole number',
    Parameter.Type.DOUBLE: 'a number',
    Parameter.Type.STRING: 'text',
    Parameter.Type.BOOL_ARRAY: 'a list of true or false',
    Parameter.Type.INTEGER_ARRAY: 'a list of whole numbers',
    Parameter.Type.DOUBLE_ARRAY: 'a list of numbers',
    Parameter.Type.STRING_ARRAY: 'a list of texts',
}


@dataclass(frozen=True)
class NodeParameter:
    """One row of a node's parameter table.

    `default` fixes the type; a list must say its element type with `element` (str, int, float or
    bool), for an empty list has none. `low` and `high` are inclusive; one of them may be left out.
    `constraints` is the plain English of what `allows` (value -> bool) checks beyond the range.
    `fixed_because` makes the parameter read-only and says why it cannot change at run time.
    `is_path` marks a file or folder: a `~` in front is the home folder, as in a shell.
    """

    name: str
    default: bool | int | float | str | list
    description: str
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    constraints: str = ''
    allows: Callable[[Any], bool] | None = None
    element: type | None = None
    fixed_because: str = ''
    is_path: bool = False

    @property
    def ros_type(self) -> Parameter.Type:
        if isinstance(self.default, list):
            element = self.element or type(self.default[0])
            return Parameter.Type.from_parameter_value([element()])
        return Parameter.Type.from_parameter_value(self.default)

    def descriptor(self) -> ParameterDescriptor:
        descriptor = ParameterDescriptor(
            name=self.name,
            type=self.ros_type.value,
            description=self.description,
            additional_constraints=self._constraints_text(),
            read_only=bool(self.fixed_because),
        )
        if self.low is None and self.high is None:
            return descriptor
        if self.ros_type == Parameter.Type.INTEGER:
            least = -INT64_MAX if self.low is None else int(self.low)
            most = INT64_MAX if self.high is None else int(self.high)
            descriptor.integer_range = [IntegerRange(from_value=least, to_value=most, step=0)]
        else:
            low = -math.inf if self.low is None else float(self.low)
            high = math.inf if self.high is None else float(self.high)
            descriptor.floating_point_range = [
                FloatingPointRange(from_value=low, to_value=high, step=0.0)
            ]
        return descriptor

    def coerced(self, value: Any) -> Any:
        """`value` as its type: YAML says 2 for 2.0, and ROS makes no value of an empty list.

        No shell has expanded the `~` of a path in a parameter file or behind `:=`.
        """
        if value is None and isinstance(self.default, list):
            return []
        if self.is_path and isinstance(value, str):
            return os.path.expanduser(value)
        if self.ros_type == Parameter.Type.DOUBLE and type(value) is int:
            return float(value)
        if self.ros_type == Parameter.Type.DOUBLE_ARRAY and isinstance(value, Sequence):
            return [float(item) if type(item) is int else item for item in value]
        return value

    def refusal(self, value: Any) -> str | None:
        """Why `value` is not acceptable, as one line, or None; type and range are rclpy's part."""
        if isinstance(value, float) and not math.isfinite(value):
            return f'{self.name} is {value}: give a finite number'
        if self.choices and value not in self.choices:
            return f'{self.name} is {value!r}: choose one of {", ".join(self.choices)}'
        if self.allows is not None and not self.allows(value):
            return f'{self.name} is {value!r}: must be {self.constraints}'
        return None

    def _constraints_text(self) -> str:
        texts = [self.constraints]
        if self.choices:
            texts = ['one of ' + ', '.join(self.choices)]
        if self.fixed_because:
            texts.append(f'cannot change while the node runs: {self.fixed_because}')
        return '; '.join(text for text in texts if text)


ParameterTable = Sequence[NodeParameter]

# A film or a difference of films [um].
thickness = functools.partial(NodeParameter, default=0.0, low=0.0, high=10_000.0)


def direction(name: str, description: str) -> NodeParameter:
    """A row for a direction of any length; empty is none."""
    return NodeParameter(
        name,
        [],
        description,
        constraints='three numbers that are not all zero, or none',
        allows=_is_direction,
        element=float,
    )


def mesh_parameters(max_edge_length_m: float) -> ParameterTable:
    """The rows of a part's mesh, with this default of `max_edge_length_m`."""
    return (
        NodeParameter('mesh_file', '', "The part's mesh: STL, PLY or OBJ [path]", is_path=True),
        NodeParameter(
            'mesh_scale',
            1.0,
            'Metres for one unit of the mesh file; 0.001 for a mesh in mm [m]',
            low=1e-9,
            high=1e3,
        ),
        NodeParameter(
            'max_edge_length_m',
            max_edge_length_m,
            'Triangles are split until no edge is longer [m]',
            low=1e-4,
            high=10.0,
        ),
        NodeParameter(
            'frame_id',
            'part',
            'Frame of the mesh and of what is published on it [name]',
            constraints='a name',
            allows=lambda value: bool(value.strip('/')),
        ),
    )


def fixed(because: str, *rows: NodeParameter) -> ParameterTable:
    """The same rows, none of which can change while the node runs, with the reason."""
    return tuple(replace(row, fixed_because=because) for row in rows)


def _is_direction(value: list[float]) -> bool:
    return not value or (len(value) == 3 and all(map(math.isfinite, value)) and any(value))


def declare_parameters(node: Node, table: ParameterTable) -> dict[str, Any]:
    """Declare every row on `node` with its overrides, keep later changes valid, return the values.

    Raises PaintError with one line for a value of the wrong type, out of range or refused, and
    for an override that no row knows, naming the nearest one.
    """
    rows = {row.name: row for row in table}
    overrides = _overrides(node)
    _refuse_unknown(node, rows, overrides)
    node.add_pre_set_parameters_callback(lambda changes: _with_homes(rows, changes))
    node.add_on_set_parameters_callback(lambda changes: _check_changes(rows, changes))
    for row in table:
        _declare(node, row, row.coerced(overrides.get(row.name, row.default)))
    return {name: node.get_parameter(name).value for name in rows}


def _overrides(node: Node) -> dict[str, Any]:
    # rclpy has no public view of the overrides that nobody declared, which is where typing
    # errors end up.
    return {name: parameter.value for name, parameter in node._parameter_overrides.items()}


def _refuse_unknown(node: Node, rows: dict[str, NodeParameter], overrides: dict[str, Any]) -> None:
    for name in overrides:
        if name in rows or name in RESERVED_NAMES or name.startswith(RESERVED_PREFIX):
            continue
        remedy = did_you_mean(name, rows)
        raise PaintError(f'{node.get_name()} has no parameter {name}; {remedy}')


def _declare(node: Node, row: NodeParameter, value: Any) -> None:
    empty_list = isinstance(value, list) and not value
    if not empty_list and Parameter.Type.from_parameter_value(value) != row.ros_type:
        expected = TYPE_WORDS[row.ros_type]
        raise PaintError(f'{node.get_name()}: {row.name} is {value!r}: give {expected}')
    try:
        if empty_list:
            _declare_empty_list(node, row)
        else:
            node.declare_parameter(row.name, value, row.descriptor(), ignore_override=True)
    except ParameterException as error:
        raise PaintError(f'{node.get_name()}: {_one_line(row, value, error)}') from None


def _declare_empty_list(node: Node, row: NodeParameter) -> None:
    # rclpy takes an empty list for bytes unless the type is declared first and the value set then.
    writable = row.descriptor()
    writable.read_only = False
    node.declare_parameter(row.name, row.ros_type, writable, ignore_override=True)
    node.set_parameters([Parameter(row.name, row.ros_type, [])])
    node.set_descriptor(row.name, row.descriptor())


def _one_line(row: NodeParameter, value: Any, error: ParameterException) -> str:
    reason = row.refusal(value)
    if reason:
        return reason
    if row.low is None and row.high is None:
        return f'{row.name} is {value!r}: {" ".join(str(error).split())}'
    bounds = [f'at least {row.low}'] if row.low is not None else []
    bounds += [f'at most {row.high}'] if row.high is not None else []
    return f'{row.name} is {value}: must be {" and ".join(bounds)}'


def refusal_of_fixed(node: Node, table: ParameterTable, changes: list[Parameter]) -> str | None:
    """Why one of the changes is refused because its parameter is fixed, as one line, or None."""
    reasons = {row.name: row.fixed_because for row in table if row.fixed_because}
    for change in changes:
        # While they are declared, parameters can still be set.
        if change.name in reasons and node.describe_parameter(change.name).read_only:
            return f'{change.name} cannot change while the node runs: {reasons[change.name]}'
    return None


def _with_homes(rows: dict[str, NodeParameter], changes: list[Parameter]) -> list[Parameter]:
    return [
        Parameter(change.name, change.type_, rows[change.name].coerced(change.value))
        if change.name in rows and rows[change.name].is_path and change.value is not None
        else change
        for change in changes
    ]


def _check_changes(
    rows: dict[str, NodeParameter], changes: list[Parameter]
) -> SetParametersResult:
    for change in changes:
        row = rows.get(change.name)
        reason = row.refusal(change.value) if row else None
        if reason:
            return SetParametersResult(successful=False, reason=reason)
    return SetParametersResult(successful=True)
