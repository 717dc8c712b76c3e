"""Why a checked value was refused, in one line: the key, its value, the range, the remedy."""

from dataclasses import asdict
from typing import Any, TypeVar, get_args

from annotated_types import Ge, Gt, Le
from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from paint_deposition.errors import PaintError, did_you_mean, quoted

NUMBERS = (float, float | None)
Made = TypeVar('Made', bound=BaseModel)


def checked(model: type[Made], where: str, values: Any, refusal: type[PaintError]) -> Made:
    """The values as a model; the first that is wrong raises ``refusal`` in one line.

    ``where`` is how the user calls what the values stand in.
    """
    try:
        made = model.model_validate(values)
    except ValidationError as error:
        raise refusal(_reason(model, where, error)) from None
    for key, value in values.items():
        field = model.model_fields[key]
        if field.annotation in NUMBERS and isinstance(value, bool):  # true would pass as 1
            raise refusal(_wrong(where, key, value, field))
    return made


def _field(model: type[BaseModel] | None, place: tuple[int | str, ...]) -> FieldInfo | None:
    """The innermost field that a place in the values stands for."""
    field = None
    for name in (part for part in place if isinstance(part, str) and model):
        field = model.model_fields.get(name) if model else None
        kinds = (field.annotation, *get_args(field.annotation)) if field else ()
        models = (k for k in kinds if isinstance(k, type) and issubclass(k, BaseModel))
        model = next(models, None)
    return field


def _reason(model: type[BaseModel], where: str, error: ValidationError) -> str:
    first, others = error.errors()[0], error.error_count() - 1
    more = f' (and {others} more)' if others else ''
    key = '.'.join(str(part) for part in first['loc'] if part != '[key]')
    if first['type'] == 'value_error':
        return f'{where}: {f"{key}: " if key else ""}{first["ctx"]["error"]}{more}'
    if not first['loc']:
        # Nothing of a text or a list: the file may be of any other kind.
        value = first['input']
        of_kind = 'text' if isinstance(value, str) else quoted(value)
        of_kind = 'a list' if isinstance(value, list) else of_kind
        fields = model.model_fields
        keys = sorted(fields, key=lambda name: not fields[name].is_required())
        return f'{where} is {of_kind}; expected the keys {", ".join(keys)}'
    if first['type'] == 'extra_forbidden':
        return f'{where}: unknown key {quoted(key)}; {did_you_mean(key, model.model_fields)}{more}'
    field = _field(model, first['loc'])
    if field is None:
        return f'{where}: unknown key {quoted(key)}; expected names of parameters{more}'
    if first['type'] == 'missing':
        return f'{where} has no {key!r}; give {_expected(field)}{more}'
    return f'{_wrong(where, key, first["input"], field)}{more}'


def _wrong(where: str, key: str, value: object, field: FieldInfo) -> str:
    return f'{where}: {key} is {quoted(value)}; expected {_expected(field)}'


def _expected(field: FieldInfo) -> str:
    if field.annotation is bool:
        return f'true or false: {field.description}'
    if field.annotation not in NUMBERS:
        return str(field.description)
    limits: dict[str, float] = {}
    for bound in field.metadata:
        if isinstance(bound, Ge | Gt | Le):
            limits |= asdict(bound)
    if 'ge' in limits:
        return f'a number {limits["ge"]:g} to {limits["le"]:g}: {field.description}'
    most = f' and up to {limits["le"]:g}' if 'le' in limits else ''
    return f'a number above {limits["gt"]:g}{most}: {field.description}'
