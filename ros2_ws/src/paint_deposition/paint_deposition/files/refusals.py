"""Why a checked value was refused, in one line: the key, its value, the range, the remedy."""

from typing import Any

from annotated_types import Ge, Gt, Le, Lt
from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from paint_deposition.errors import did_you_mean


def refusal(model: type[BaseModel], where: str, error: ValidationError) -> str:
    """One line for the first error of a validation.

    Args:
        model: what was to be made.
        where: how the user calls it.
        error: as pydantic raised it.
    """
    first, others = error.errors()[0], error.error_count() - 1
    more = f' (and {others} more)' if others else ''
    if not first['loc']:
        return f'{where} is {first["input"]!r}; expected the keys {", ".join(model.model_fields)}'
    key = '.'.join(str(part) for part in first['loc'])
    if first['type'] == 'extra_forbidden':
        return f'{where}: unknown key {key!r}; {did_you_mean(key, model.model_fields)}{more}'
    field = model.model_fields.get(str(first['loc'][0]))
    if field is None:
        return f'{where}: {first["msg"]}{more}'
    if first['type'] == 'missing':
        return f'{where} has no {key!r}; give {_expected(field)}{more}'
    return f'{where}: {key} is {first["input"]!r}; expected {_expected(field)}{more}'


def boolean_number(model: type[BaseModel], where: str, values: dict[str, Any]) -> str | None:
    """One line where true stands for a number, which would pass as 1; else None."""
    for key, value in values.items():
        field = model.model_fields.get(key)
        if field is not None and field.annotation is float and isinstance(value, bool):
            return f'{where}: {key} is {value!r}; expected {_expected(field)}'
    return None


def _expected(field: FieldInfo) -> str:
    if field.annotation is bool:
        return f'true or false: {field.description}'
    if field.annotation is not float:
        return str(field.description)
    limits = {
        kind: getattr(bound, name)
        for bound in field.metadata
        for kind, name in ((Ge, 'ge'), (Gt, 'gt'), (Le, 'le'), (Lt, 'lt'))
        if isinstance(bound, kind)
    }
    words = [f'above {limits[Gt]:g}' if Gt in limits else '']
    if Ge in limits and Le in limits:
        words.append(f'{limits[Ge]:g} to {limits[Le]:g}')
    elif Le in limits:
        words.append(f'up to {limits[Le]:g}')
    elif Ge in limits:
        words.append(f'at least {limits[Ge]:g}')
    number = ' and '.join(filter(None, words))
    return f'a number {number}: {field.description}'
