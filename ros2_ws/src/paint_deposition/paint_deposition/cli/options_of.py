"""Options of a command from the model of its request: names, types, bounds, defaults and help."""

import math
import re
from collections.abc import Callable
from functools import reduce, wraps
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, Literal, get_args, get_origin

import click
from annotated_types import Ge, Gt, Le, Lt, MaxLen
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from paint_deposition.cli.options import FILE, FiniteRange
from paint_deposition.errors import PaintError


def options_of(kind: type[BaseModel], into: str = 'request') -> Callable[[Callable], Callable]:
    """Give a command an option for each field of a request; it takes the request as one argument.

    An option is called as its field, or by ``option`` in the field's ``json_schema_extra``; its
    help is the field's description. A field in radians is an option in degrees.

    Args:
        kind: the model. Fields may be numbers, words, choices, flags, paths, and tuples or lists
            of a fixed length; one whose default is None may be left out.
        into: name of the argument of the command that takes the request.
    """
    names = list(kind.model_fields)
    called = {name: _option_name(name, kind.model_fields[name]) for name in names}

    def with_options(command: Callable) -> Callable:
        @wraps(command)
        def with_request(**values: Any) -> Any:
            own = {name: values.pop(name) for name in names}
            own = {name: value for name, value in own.items() if value is not None}
            for name in own.keys() & set(filter(_is_angle, names)):
                own[name] = math.radians(own[name])
            try:
                return command(**{into: kind(**own)}, **values)
            except PaintError as error:
                # Of names with a unit only: others are also words of a sentence.
                named = {name: option for name, option in called.items() if '_' in name}
                said = re.sub(r'\w+', lambda word: named.get(word[0], word[0]), str(error))
                raise type(error)(said) from None

        options = (_option(name, kind.model_fields[name]) for name in reversed(names))
        return reduce(lambda taken, option: option(taken), options, with_request)

    return with_options


def _is_angle(name: str) -> bool:
    return name.endswith('_rad')


def _extra(field: FieldInfo) -> dict[str, Any]:
    return field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}


def _option_name(name: str, field: FieldInfo) -> str:
    """The option of a field."""
    usual = f'--{name.removesuffix("_rad")}-deg' if _is_angle(name) else f'--{name}'
    return str(_extra(field).get('option', usual.replace('_', '-')))


def _option(name: str, field: FieldInfo) -> Callable:
    extra = _extra(field)
    known = field.get_default(call_default_factory=True)
    if _is_angle(name) and known is not None:
        known = math.degrees(known)
    annotation, metadata = _bare(field.annotation, field.metadata)
    settings: dict[str, Any] = {'help': field.description, 'default': known}
    if annotation is bool:
        settings['is_flag'] = True
    else:
        shown = math.degrees if _is_angle(name) else lambda bound: bound
        settings |= _type(annotation, metadata, shown) | {'show_default': known is not None}
    if 'metavar' in extra:
        settings['metavar'] = extra['metavar']
    return click.option(_option_name(name, field), name, **settings)


def _bare(annotation: Any, metadata: list[Any]) -> tuple[Any, list[Any]]:
    """A type without None and annotations, and what these say."""
    while True:
        others = [kind for kind in get_args(annotation) if kind is not NoneType]
        if get_origin(annotation) is Annotated:
            annotation, metadata = others[0], [*metadata, *others[1:]]
        elif len(others) < len(get_args(annotation)):
            (annotation,) = others
        else:
            flat = (getattr(one, 'metadata', [one]) for one in metadata)
            return annotation, [one for ones in flat for one in ones]


def _type(
    annotation: Any, metadata: list[Any], shown: Callable[[Any], Any] = lambda bound: bound
) -> dict[str, Any]:
    """Settings of click for a type; ``shown`` brings bounds to the option's unit."""
    origin, within = get_origin(annotation), get_args(annotation)
    if origin is Literal:
        return {'type': click.Choice(list(within))}
    if origin in (tuple, list):
        longest = next((one.max_length for one in metadata if isinstance(one, MaxLen)), None)
        inner, about = _bare(within[0], [])
        return _type(inner, about) | {'nargs': longest if origin is list else len(within)}
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
