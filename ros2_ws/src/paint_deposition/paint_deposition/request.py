"""What commands, nodes, scripts and files say, checked once: models with all defaults and limits.

A request is one such model. The options of a command (``cli/options_of.py``), the signature of its
verb and the schema of what is written of it follow from it.
"""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any, ClassVar, TypeVar, get_args

from annotated_types import Ge, Gt, Le, Lt
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic.fields import FieldInfo

from paint_deposition.errors import PaintError, PlanError, did_you_mean, quoted

Verb = TypeVar('Verb', bound=Callable)
Made = TypeVar('Made', bound=BaseModel)


class Request(BaseModel):
    """Base of all requests: checked once, when it is made, and never changed.

    Raises:
        PaintError: of ``error_class``, with one line for the first value that is wrong.
    """

    model_config = ConfigDict(frozen=True, extra='forbid', allow_inf_nan=False)
    error_class: ClassVar[type[PaintError]] = PlanError

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
        option: of the command; default: the name of the field.
        above, below: bounds that are not included; least, most: bounds that are.
        metavar: what stands for the value in the help.
    """
    extra = {'option': option, 'metavar': metavar}
    return Field(
        default, description=text, gt=above, lt=below, ge=least, le=most,
        json_schema_extra={name: value for name, value in extra.items() if value},
    )  # fmt: skip


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
    value, field = first['input'], _field(model, first['loc'])
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
    if where:
        return f'{place}{key} is {quoted(value)}; expected {_expected(field)}{more}'
    # What a file takes stands in the descriptions of its keys, what a request takes does not.
    shown = f'{value:g}' if isinstance(value, float) else quoted(value)
    choice = f'{first["ctx"]["expected"]}: ' if first['type'] == 'literal_error' else ''
    return f'{key} is {shown}; expected {choice}{_expected(field, (float, int))}{more}'


def _field(model: type[BaseModel] | None, place: tuple[int | str, ...]) -> FieldInfo | None:
    """The innermost field that a place in the values stands for."""
    field = None
    for name in (part for part in place if isinstance(part, str) and model):
        field = model.model_fields.get(name) if model else None
        kinds = (field.annotation, *get_args(field.annotation)) if field else ()
        models = (k for k in kinds if isinstance(k, type) and issubclass(k, BaseModel))
        model = next(models, None)
    return field


def _takes_a(field: FieldInfo, kinds: tuple[type, ...]) -> bool:
    """Whether a field takes one number of these kinds, or none."""
    return field.annotation in (*kinds, *(kind | None for kind in kinds))


def _expected(field: FieldInfo, numbers: tuple[type, ...] = (float,)) -> str:
    """What a field takes: for these kinds of numbers the range, and what it means."""
    if field.annotation is bool:
        return f'true or false: {field.description}'
    if not _takes_a(field, numbers):
        return str(field.description)
    limits: dict[str, float] = {}
    for bound in field.metadata:
        if isinstance(bound, Ge | Gt | Le | Lt):
            limits |= asdict(bound)
    if 'ge' in limits and 'le' in limits:
        return f'a number {limits["ge"]:g} to {limits["le"]:g}: {field.description}'
    words = {'gt': 'above', 'ge': 'of at least', 'lt': 'below', 'le': 'up to'}
    bounds = ' and '.join(f'{words[k]} {limits[k]:g}' for k in words if k in limits)
    return f'a number {bounds}: {field.description}'.replace('number :', 'number:')
