"""Options of commands: those of a request from its model, and those that commands share."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import reduce, wraps
from pathlib import Path
from types import MappingProxyType, NoneType
from typing import Annotated, Any, Literal, get_args, get_origin

import click
from annotated_types import Ge, Gt, Le, Lt, MaxLen
from click.core import ParameterSource
from pydantic import BaseModel
from pydantic.fields import FieldInfo

import paint_deposition as pd
from paint_deposition.errors import PaintError
from paint_deposition.request import MotionOptions, OnePart, Request, is_pose

Decorator = Callable[[Callable], Callable]


class FiniteRange(click.FloatRange):
    """A finite number, within bounds if there are any; else it says what is wanted."""

    def __init__(self, *ends: Any, **bounds: Any) -> None:
        super().__init__(*ends, **bounds)
        self.name = 'float range' if ends or bounds else 'float'

    def _describe_range(self) -> str:  # of click, whose help says `x<=None` without bounds
        return super()._describe_range() if self.name == 'float range' else ''

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        try:
            number = super().convert(value, param, ctx)
            if not math.isfinite(number):  # `nan` and `inf` are numbers to Python
                raise click.BadParameter(f'{value} is not finite; give a number', ctx, param)
        except click.BadParameter as error:
            if not isinstance(param, click.Option) or not param.help:
                raise
            metres = ', in metres' if str(param.name).endswith('_m') else ''
            words = f'{error.message.rstrip(".")}{metres}; wanted: {param.help.rstrip(".")}'
            raise click.BadParameter(words, ctx, param) from None
        return number


class File(click.Path):
    """A path that is not empty, as an unset variable of the shell would give."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if value == '':
            name = param.opts[0] if param else 'the path'
            raise click.UsageError(f'{name} is empty; give a path', ctx)
        return super().convert(value, param, ctx)


NUMBER, POSITIVE, NOT_NEGATIVE = FiniteRange(), FiniteRange(0.0, min_open=True), FiniteRange(0.0)
FILE = File(path_type=Path)
FOLDER = File(path_type=Path, file_okay=False)


def options_of(
    kind: type[BaseModel], into: str = 'request', **settings: dict[str, Any]
) -> Decorator:
    """Give a command an option for each field of a model; it takes them as one argument.

    The argument is the request, or of a model that is none the values by name, which whoever reads
    the motion or the mesh checks.

    Args:
        kind: the model. Fields may be numbers, words, choices, flags, paths, and tuples or lists
            of a fixed length; one whose default is None may be left out.
        into: name of the argument of the command.
        settings: of click, by field, for what the model does not say.
    """
    fields = kind.model_fields
    options = {name: option_of(kind, name, **settings.get(name, {})) for name in fields}
    # Of names with a unit only: others are also words of a sentence.
    called = {name: _names(name, field)[0] for name, field in fields.items() if '_' in name}

    def made(**values: Any) -> Any:
        if not issubclass(kind, Request):
            return values
        own = {name: value for name, value in values.items() if value is not None}
        return kind(**{n: math.radians(v) if n.endswith('_rad') else v for n, v in own.items()})

    return option_group(options, into, made, called)


def option_group(
    options: Mapping[str, Decorator],
    into: str,
    kind: Callable[..., Any] = dict,
    called: Mapping[str, str] = MappingProxyType({}),
) -> Decorator:
    """Give a command options by their names; it takes them as one argument, of a kind.

    In what the command then raises, words that are ``called`` otherwise as options are renamed.
    """

    def with_group(command: Callable) -> Callable:
        @wraps(command)
        def with_one(**given: Any) -> Any:
            try:
                return command(**{into: kind(**{n: given.pop(n) for n in options})}, **given)
            except PaintError as error:
                # A whole word, and no part of a name of a file.
                words = r'(?<![\w./-])\w+(?![\w/-]|\.\w)'
                said = re.sub(words, lambda word: called.get(word[0], word[0]), str(error))
                raise type(error)(said) from None

        each = reversed([*options.values()])
        return reduce(lambda taken, option: option(taken), each, with_one)

    return with_group


def option_of(kind: type[BaseModel], name: str, **settings: Any) -> Decorator:
    """The option of one field of a model: name, type, bounds, default and help.

    A field in radians is an option in degrees. ``settings`` are further ones of click.
    """
    field = kind.model_fields[name]
    known = field.get_default(call_default_factory=True)
    shown: Callable[[Any], Any] = math.degrees if name.endswith('_rad') else lambda value: value
    default = None if known is None else shown(known)
    found = _type(field.annotation, field.metadata, shown)
    found |= {'help': field.description, 'default': default}
    if 'is_flag' not in found:
        found['show_default'] = known is not None
    if 'metavar' in _extra(field):
        found['metavar'] = _extra(field)['metavar']
    return click.option(*_names(name, field), name, **found | settings)


def _extra(field: FieldInfo) -> dict[str, Any]:
    return field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}


def _names(name: str, field: FieldInfo) -> list[str]:
    """What the option of a field is called."""
    usual = f'--{name.removesuffix("_rad")}-deg' if name.endswith('_rad') else f'--{name}'
    return str(_extra(field).get('option', usual.replace('_', '-'))).split()


def _type(annotation: Any, metadata: list[Any], shown: Callable[[Any], Any]) -> dict[str, Any]:
    """Settings of click for a type; ``shown`` brings bounds to the option's unit."""
    origin, within = get_origin(annotation), get_args(annotation)
    others = [kind for kind in within if kind is not NoneType]
    if origin is Annotated:
        flat = (getattr(one, 'metadata', [one]) for one in others[1:])
        return _type(others[0], [*metadata, *(one for ones in flat for one in ones)], shown)
    if len(others) < len(within):
        return _type(others[0], metadata, shown)
    if annotation is bool:
        return {'is_flag': True}
    if origin is Literal:
        return {'type': click.Choice(list(within))}
    if origin in (tuple, list):
        longest = next((one.max_length for one in metadata if isinstance(one, MaxLen)), None)
        count = longest if origin is list else len(within)
        return _type(within[0], [], shown) | {'nargs': count}
    if annotation is Path:
        return {'type': FILE}
    if annotation not in (float, int):
        return {'type': annotation}
    ends = {Gt: ('min', 'gt'), Ge: ('min', 'ge'), Lt: ('max', 'lt'), Le: ('max', 'le')}
    bounds: dict[str, Any] = {}
    for one in metadata:
        if type(one) in ends:
            end, key = ends[type(one)]
            bounds |= {end: shown(getattr(one, key)), f'{end}_open': key in ('gt', 'lt')}
    if annotation is int:
        return {'type': click.IntRange(**bounds) if bounds else int}
    return {'type': FiniteRange(**bounds)}


def _pose(ctx: click.Context, param: click.Parameter, given: tuple | None) -> list[float] | None:
    if given is None:
        return None
    if not is_pose(given):
        words = f'the quaternion qx qy qz qw has the norm {math.hypot(*given[3:]):.4g}, not 1'
        raise click.BadParameter(words, ctx, param)
    return list(given)


def _allow_effects(ctx: click.Context, param: click.Parameter, given: bool) -> None:
    if given:
        from paint_deposition.files.effect_file import effects_allowed

        token = effects_allowed.set(True)
        ctx.call_on_close(lambda: effects_allowed.reset(token))


def _band(target_um: float, tolerance_um: float) -> dict[str, float]:
    if tolerance_um and not target_um:
        raise PaintError('tolerance_um has no target_um; give both')
    return {'target_um': target_um, 'tolerance_um': tolerance_um}


JSON = click.option('--json', 'as_json', is_flag=True, help='Print the figures as JSON.')
CAMPAIGN = click.argument('campaign', type=FILE)
POINTS = click.option(
    '--points', 'points_file', type=FILE,
    help='Measuring points, label and x, y, z, of readings that name their point only.',
)  # fmt: skip
BRUSH = click.option(
    '--brush', default=0, type=click.IntRange(min=0), show_default='the only one',
    help='Number of the brush to work with, of a model with several.',
)  # fmt: skip
ALLOW_EFFECTS = click.option(
    '--allow-effects', is_flag=True, expose_value=False, callback=_allow_effects,
    help='Run the Python code of effect files that recordings or campaigns name, too.',
)  # fmt: skip
PART_POSE = option_of(MotionOptions, 'part_pose', callback=_pose)
MAX_POSE_GAP = option_of(OnePart, 'max_pose_gap_s')
motion_options = options_of(MotionOptions, 'motion', part_pose={'callback': _pose})
band_options = option_group(
    {
        'target_um': click.option(
            '--target-um', default=0.0, type=NOT_NEGATIVE, show_default='none',
            help='Target film [µm].',
        ),
        'tolerance_um': click.option(
            '--tolerance-um', default=0.0, type=NOT_NEGATIVE, show_default='none',
            help='Accepted difference from the target, either way [µm].',
        ),
    },
    'band', _band, {'target_um': '--target-um', 'tolerance_um': '--tolerance-um'},
)  # fmt: skip
JOINT_ACCELERATION = click.option(
    '--joint-acceleration', type=POSITIVE,
    help='Greatest acceleration of every joint of a robot that is to drive the motion [rad/s2 or '
    'm/s2]; default: full speed in a quarter of a second.',
)  # fmt: skip
ROBOT = ('urdf', 'tip_link', 'base_link')
robot_options = option_group(
    {name: option_of(MotionOptions, name) for name in ROBOT}
    | {'joint_acceleration': JOINT_ACCELERATION},
    'robot',
)


def model_option(text: str = 'Deposition model, YAML; default: a 50 mm bell.') -> Decorator:
    """The model that a command begins with."""
    return click.option('--model', 'model_file', type=FILE, help=text)


def seed_option(of: str) -> Decorator:
    """The seed of what a command draws at random."""
    return click.option('--seed', default=0, show_default=True, help=f'Random seed of {of}.')


def given_beside(*names: str) -> list[str]:
    """The options of this command that the user gave, but those of these parameters."""
    context = click.get_current_context()
    return [
        one.opts[0] for one in context.command.params
        if one.name not in names
        and context.get_parameter_source(one.name or '') is ParameterSource.COMMANDLINE
    ]  # fmt: skip


@dataclass(frozen=True)
class Part:
    """The part of a command, and how its files are read."""

    mesh: Path | None
    max_edge_length_m: float
    mesh_scale: float
    body: str | None
    down: tuple[float, float, float] | None
    zones_file: Path | None = None

    def surface(self, mesh: Path | None = None) -> pd.Surface:
        """The refined mesh, or that of another file."""
        import numpy as np

        down = None if self.down is None else np.array(self.down)
        file = mesh or self.mesh or Path()
        return pd.read_mesh(file, self.mesh_scale, self.max_edge_length_m, down, self.body)

    def zones(self) -> pd.Zones | None:
        """Its regions with targets of their own, if there are any."""
        if self.zones_file is None:
            return None
        return pd.read_zones(self.zones_file, self.mesh or '', self.mesh_scale, self.body)


def part_options(
    max_edge_length_m: float, required: bool = True, zones: bool = False
) -> Decorator:
    """A command takes the ``Part``."""
    options: dict[str, Decorator] = {
        'mesh': click.option(
            '--mesh', required=required, type=FILE, help='The part: STL, PLY, OBJ, glTF or STEP.'
        ),
        **{name: option_of(OnePart, name) for name in ('mesh_scale', 'body', 'down')},
        'max_edge_length_m': click.option(
            '--max-edge-length-m', default=max_edge_length_m, show_default=True, type=POSITIVE,
            help='Longest edge of the refined mesh: larger triangles are split.',
        ),
    }  # fmt: skip
    if zones:
        options['zones_file'] = click.option(
            '--zones', 'zones_file', type=FILE,
            help='Regions of the part with a target and a tolerance of their own, YAML; '
            'elsewhere --target-um holds.',
        )  # fmt: skip
    return option_group(options, 'part', Part)
