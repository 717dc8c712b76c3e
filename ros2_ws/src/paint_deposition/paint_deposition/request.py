"""What commands, nodes, scripts and files say, checked once: models with all defaults and limits.

Each thing that can be asked for is described here or in a request of its own room, and only there.
The options of a command (``cli/options.py``), the signature of its verb, the keys of files and
their tables in the documentation follow from it.
"""

import inspect
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Annotated, Any, ClassVar, Literal, TypeVar, get_args, get_origin

from annotated_types import Ge, Gt, Le, Lt
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    field_validator,
)
from pydantic.fields import FieldInfo

from paint_deposition.errors import PaintError, did_you_mean, quoted

Verb = TypeVar('Verb', bound=Callable)
Made = TypeVar('Made', bound=BaseModel)
Text = Annotated[str, Field(min_length=1)]


def _as_text(value: Any) -> str:
    if isinstance(value, bool | float | list | dict):
        raise ValueError(f'{quoted(value)} is no text; put it in quotes')
    return '' if value is None else str(value)


# A name, a date or a whole number, read as text; a number such as 12.10 has lost its last digit.
Name = Annotated[str, BeforeValidator(_as_text)]
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]


class Request(BaseModel):
    """Base of all requests: checked once, when it is made, and never changed.

    Raises:
        PaintError: of ``error_class``, with one line for the first value that is wrong.
    """

    model_config = ConfigDict(frozen=True, extra='forbid', allow_inf_nan=False)
    error_class: ClassVar[type[PaintError]] = PaintError

    def __init__(self, **values: Any) -> None:
        try:
            super().__init__(**values)
        except ValidationError as error:
            raise self.error_class(_reason(type(self), '', error)) from None


def given(
    default: Any,
    text: str,
    option: str | None = None,
    *,
    above: float | None = None,
    below: float | None = None,
    least: float | None = None,
    most: float | None = None,
    metavar: str | None = None,
) -> Any:
    """A field of a request.

    Args:
        default: its value where none is given; None: it may be left out.
        text: what it is, with its unit; the help of its option.
        option: of the command, several names with blanks between them; default: the name of the
            field.
        above, below: bounds that are not included; least, most: bounds that are.
        metavar: what stands for the value in the help.
    """
    extra = {'option': option, 'metavar': metavar}
    return Field(
        default, description=text, gt=above, lt=below, ge=least, le=most,
        json_schema_extra={name: value for name, value in extra.items() if value},
    )  # fmt: skip


# RAPID writes quaternions with four digits; further off is damage, not rounding.
QUATERNION_TOLERANCE = 0.01
POSE_FORMAT = 'seven numbers, x y z [m] and a unit quaternion qx qy qz qw'
# Makers' conventions in the letters of scipy: capital letters turn about the axes of the tool as
# it goes, small ones about those of the world.
CONVENTIONS = {
    'kuka': 'ZYX', 'abb': 'ZYX', 'fanuc': 'xyz', 'rpy': 'xyz', 'staubli': 'XYZ', 'kawasaki': 'ZYZ',
}  # fmt: skip
ROTATION_WORDS = (
    "'rotvec' for a rotation vector, three letters for Euler angles (ZYX about the axes of the "
    'tool, xyz about fixed axes), or kuka, abb, fanuc, rpy, staubli, kawasaki'
)


def is_pose(values: Sequence[float]) -> bool:
    """Whether these are seven finite numbers whose last four are nearly a unit quaternion."""
    if len(values) != 7 or not all(map(math.isfinite, values)):
        return False
    return abs(math.hypot(*values[3:]) - 1.0) <= QUATERNION_TOLERANCE


class OnePart(BaseModel):
    """How the mesh of a part is read, and the motion over it."""

    mesh_scale: Number = given(
        1.0,
        'Metres per unit of the mesh file; 0.001 for millimetres. glTF and STEP name their unit: '
        'leave it out there.', above=0.0,
    )  # fmt: skip
    body: Text | None = given(
        None, 'The one body to take of a mesh file with several; default: all as one part.'
    )
    down: Annotated[list[Number], Field(min_length=3, max_length=3)] | None = given(
        None, 'Gravity in the mesh frame, three numbers; default: -z, or -y if drawn flat at '
        'z = 0.',
        metavar='X Y Z',
    )  # fmt: skip
    max_pose_gap_s: Number = given(
        0.25, 'A longer interval between poses is a gap, in which the gun is off [s].', above=0.0
    )


class MotionOptions(BaseModel, extra='forbid'):
    """What to read of a motion file, and where the part stands; None: not given."""

    urdf: Text | None = given(
        None, 'URDF of the robot whose joints the file has, or that is to drive the motion.'
    )
    tip_link: Text | None = given(
        None, 'Link of the URDF that is the TCP; default: tool0, else its last link.',
        '--tip --tip-link',
    )  # fmt: skip
    base_link: Text | None = given(
        None, 'Link of the URDF for the frame of the poses; default: its root.',
        '--base --base-link',
    )  # fmt: skip
    pose_topic: Text | None = given(
        None, 'Topic of the poses in a bag; default: its only PoseStamped topic. With a URDF: '
        'joint states, several with blanks between them.',
    )  # fmt: skip
    state_topic: Text | None = given(
        None, 'Trigger of the gun: a topic of AtomizerState or Bool, a number in a field of any '
        'message, as /io.states[3] or "/io.level > 12", or the column of a table; default: of a '
        'table the column trigger, gun, spraying or on, of RAPID its outputs, of a bag that plan '
        'or improve wrote its own, else it sprays whenever poses flow.', '--state-topic --trigger',
    )  # fmt: skip
    gun_signal: Text | None = given(
        None, 'Digital output that opens the gun, for a RAPID module that sets several.'
    )
    procedure: Text | None = given(None, 'Where a RAPID program starts; default: main.')
    tf: Annotated[list[Text], Field(min_length=2, max_length=2)] | None = given(
        None, 'The motion as transforms of the bag: frame SOURCE, that of the TCP, in frame '
        'TARGET.', metavar='TARGET SOURCE',
    )  # fmt: skip
    joint_prefix: Text | None = given(
        None, "What the joints' names have before those of the URDF, or lack: irb_."
    )
    pose_unit: Literal['m', 'mm', 'cm'] | None = given(
        None, 'Unit of positions and rails; default: that of the headings, else m.'
    )
    rotation: Text | None = given(
        None, 'Three numbers of an orientation in a table: rotvec, or Euler angles as ZYX (axes '
        'of the tool), xyz (fixed axes), kuka, abb, fanuc, rpy, staubli, kawasaki.',
        metavar='CONVENTION',
    )  # fmt: skip
    angle_unit: Literal['deg', 'rad'] | None = given(
        None,
        "Unit of joints and angles; default: that of the headings, else deg for a maker's "
        'angles and rad for others.',
    )
    tool_axis: Literal['x', 'y', 'z', '-x', '-y', '-z'] | None = given(
        None, 'Axis of the recorded tool along which it sprays, x for a KUKA; default: z.'
    )
    frame_id: Text | None = given(None, "Name of the part's frame; default: part.")
    strict: bool = given(
        False, 'Refuse a recording with a pose that nothing places, or with states or joints that '
        'would be left out.'
    )  # fmt: skip
    part_pose: Annotated[list[Number], Field(min_length=7, max_length=7)] | None = given(
        None, 'Where the part stands in the frame of the poses: x y z [m] and the unit quaternion '
        'qx qy qz qw.',
        metavar='X Y Z QX QY QZ QW',
    )  # fmt: skip

    @field_validator('part_pose')
    @classmethod
    def _is_pose(cls, values: list[float] | None) -> list[float] | None:
        if values is not None and not is_pose(values):
            raise ValueError(f'{values} is no pose; give {POSE_FORMAT}')
        return values

    @field_validator('rotation')
    @classmethod
    def _is_rotation(cls, name: str | None) -> str | None:
        if name is None or name.lower() in ('rotvec', *CONVENTIONS):
            return name and name.lower()
        # Two turns in a row about one axis are one, and no convention.
        if not re.fullmatch(r'[xyz]{3}|[XYZ]{3}', name) or name[1] in (name[0], name[2]):
            raise ValueError(f'{name!r} is no convention; give {ROTATION_WORDS}')
        return name


def takes(*kinds: type[BaseModel]) -> Callable[[Verb], Verb]:
    """Show the fields of requests in the signature of a verb that takes them as keywords."""

    def with_signature(verb: Verb) -> Verb:
        signature = inspect.signature(verb)
        own = [p for p in signature.parameters.values() if p.kind is not p.VAR_KEYWORD]
        fields = [
            inspect.Parameter(
                name, inspect.Parameter.KEYWORD_ONLY, default=field.default,
                annotation=field.annotation,
            )
            for kind in kinds for name, field in kind.model_fields.items()
        ]  # fmt: skip
        vars(verb)['__signature__'] = signature.replace(parameters=[*own, *fields])
        return verb

    return with_signature


def validate(
    model: type[Made], where: str, values: Mapping[str, Any], error_class: type[PaintError]
) -> Made:
    """Values that a file or an option gives, as a model.

    ``where`` is how the user calls what the values stand in. Raises ``error_class`` in one line
    for the first that is wrong.
    """
    try:
        made = model.model_validate(values)
    except ValidationError as error:
        raise error_class(_reason(model, where, error)) from None
    for key, value in values.items():
        field = model.model_fields[key]
        if isinstance(value, bool) and _takes_a(field, (float,)):  # true would pass as 1
            raise error_class(f'{where}: {key} is {value}; expected {_expected(field)}')
    return made


def _reason(model: type[BaseModel], where: str, error: ValidationError) -> str:
    """Why values were refused: the first that is wrong, what was expected, and how many more."""
    first, others = error.errors()[0], error.error_count() - 1
    more = f' (and {others} more)' if others else ''
    key = '.'.join(str(part) for part in first['loc'] if part != '[key]')
    place = where and f'{where}: '
    value, field = first['input'], None
    inner: type[BaseModel] | None = model
    for name in (part for part in first['loc'] if isinstance(part, str) and inner):
        field = inner.model_fields.get(name) if inner else None
        kinds = (field.annotation, *get_args(field.annotation)) if field else ()
        models = (k for k in kinds if isinstance(k, type) and issubclass(k, BaseModel))
        inner = next(models, None)
    if first['type'] == 'value_error':
        return f'{place}{f"{key}: " if key else ""}{first["ctx"]["error"]}{more}'
    if not first['loc']:
        # Nothing of a text or a list: the file may be of any other kind.
        of_kind = 'text' if isinstance(value, str) else quoted(value)
        of_kind = 'a list' if isinstance(value, list) else of_kind
        fields = model.model_fields
        keys = sorted(fields, key=lambda name: not fields[name].is_required())
        return f'{where} is {of_kind}; expected the keys {", ".join(keys)}'
    if first['type'] == 'extra_forbidden' or field is None:
        remedy = 'expected names of parameters'
        if first['type'] == 'extra_forbidden':
            remedy = did_you_mean(key, model.model_fields)
        return f'{place}unknown key {quoted(key)}; {remedy}{more}'
    if first['type'] == 'missing':
        return f'{place[:-2]} has no {key!r}; give {_expected(field)}{more}'
    shown = f'{value:g}' if isinstance(value, float) and not where else quoted(value)
    one_of = first['type'] == 'literal_error' and get_origin(field.annotation) is not dict
    choice = f'{first["ctx"]["expected"]}: ' if one_of else ''
    numbers = (float,) if where else (float, int)
    return f'{place}{key} is {shown}; expected {choice}{_expected(field, numbers)}{more}'


def range_end(value: float) -> str:
    """The end of a range, a whole number with all its digits."""
    return f'{value:.10g}' if float(value).is_integer() else f'{value:g}'


def _takes_a(field: FieldInfo, kinds: tuple[type, ...]) -> bool:
    """Whether a field takes one number of these kinds, or none."""
    return field.annotation in (*kinds, *(kind | None for kind in kinds))


def _expected(field: FieldInfo, numbers: tuple[type, ...] = (float,)) -> str:
    """What a field takes: for these kinds of numbers the range, and what it means."""
    # The description within a sentence.
    text = str(field.description).rstrip('.')
    means = text if text[:2].isupper() else text[:1].lower() + text[1:]
    if field.annotation is bool:
        return f'true or false: {means}'
    if not _takes_a(field, numbers):
        return means
    limits: dict[str, float] = {}
    for bound in field.metadata:
        if isinstance(bound, Ge | Gt | Le | Lt):
            limits |= asdict(bound)
    if 'ge' in limits and 'le' in limits:
        return f'a number {range_end(limits["ge"])} to {range_end(limits["le"])}: {means}'
    words = {'gt': 'above', 'ge': 'of at least', 'lt': 'below', 'le': 'up to'}
    bounds = ' and '.join(f'{words[k]} {range_end(limits[k])}' for k in words if k in limits)
    return f'a number {bounds}: {means}'.replace('number :', 'number:')
