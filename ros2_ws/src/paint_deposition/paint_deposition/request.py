"""What a command, a node or a script asks for: one model a request, with all defaults and limits.

The options of a command (``cli/options_of.py``), the signature of its verb and the schema of what
is written of it follow from these models.
"""

import inspect
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from paint_deposition.errors import PaintError, PlanError, did_you_mean, quoted

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

Verb = TypeVar('Verb', bound=Callable)
# How bounds are said.
BOUNDS = {
    'greater than or equal to': 'at least',
    'less than or equal to': 'at most',
    'greater than': 'a number above',
    'less than': 'a number below',
}


class Request(BaseModel):
    """Base of all requests: checked once, when it is made, and never changed.

    Raises:
        PaintError: of the class ``refusal``, with one line for the first value that is wrong.
    """

    model_config = ConfigDict(frozen=True, extra='forbid', allow_inf_nan=False)
    refusal: ClassVar[type[PaintError]] = PlanError

    def __init__(self, **values: Any) -> None:
        try:
            super().__init__(**values)
        except ValidationError as error:
            raise self.refusal(reason(error, type(self))) from None


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


def reason(error: ValidationError, kind: type[BaseModel]) -> str:
    """Why values were refused, in one line: the first that is wrong, and the remedy."""
    first = error.errors()[0]
    name = '.'.join(str(part) for part in first['loc'])
    if first['type'] == 'extra_forbidden':
        return f'{name} is no option here; {did_you_mean(name, kind.model_fields)}'
    if first['type'] == 'value_error':
        return f'{name}: {first["ctx"]["error"]}' if name else str(first['ctx']['error'])
    field = kind.model_fields.get(str(first['loc'][0]))
    about = f': {field.description}' if field and field.description else ''
    return f'{name} {is_wrong(first)}{about}'


def is_wrong(first: 'ErrorDetails') -> str:
    """'is VALUE; give REMEDY' for what is wrong with a value."""
    value, remedy = first['input'], first['msg'].removeprefix('Input should be ')
    for long, short in BOUNDS.items():
        remedy = remedy.replace(long, short)
    shown = f'{value:g}' if isinstance(value, float) else quoted(value)
    return f'is {shown}; give {remedy}'


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
