"""ABB RAPID modules as data: declarations, and routines as trees of statements.

RAPID ignores case: all is converted to lower case.
"""

import json
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any, NamedTuple

from lark import Lark, Token, Transformer, Tree, UnexpectedInput, v_args

from paint_deposition.errors import RecordingError, quoted


class Instruction(NamedTuple):
    """An instruction or a procedure call; an option without a value is True."""

    name: str
    line: int
    values: list
    options: dict[str, Any]


@dataclass
class Datum:
    """A datum: its type, the sizes of an array, and its value, None without.

    Until it is first needed (``is_declared``) the value is the expression that it begins with. As
    a parameter of a routine it may be ``optional``; what is assigned to a ``shared`` one reaches
    the caller.
    """

    name: str
    type: str
    value: Any = None
    sizes: list | None = None
    is_declared: bool = False
    optional: bool = False
    shared: bool = False


class Routine(NamedTuple):
    """A procedure, function or trap."""

    name: str
    parameters: list[Datum]
    body: Tree
    source: str
    is_procedure: bool


class Module(NamedTuple):
    """What a module declares: for all modules, and for itself alone."""

    name: str
    source: str
    shared: list[Datum | Routine]
    local: list[Datum | Routine]


@v_args(inline=True)
class _Builder(Transformer):
    """Constants, instructions and declarations as they are; all else as trees."""

    number = float

    def numbers(self, text: str) -> list:
        return json.loads(text, parse_int=float)

    def string(self, text: str) -> str:
        return text[1:-1].replace('""', '"')

    def true(self) -> bool:
        return True

    def false(self) -> bool:
        return False

    def items(self, *items: Any) -> list:
        return [*items]

    def sign(self, sign: str, value: Any) -> Any:
        if isinstance(value, float):
            return -value if sign == '-' else value
        return Tree('operation', [0.0, sign, value])

    def aggregate(self, items: list) -> Any:
        return Tree('aggregate', [items]) if any(isinstance(i, Tree) for i in items) else items

    def option(self, name: str, value: Any) -> dict[str, Any]:
        return {str(name): True if value is None else value}

    argument = items

    def arguments(self, *arguments: list | None) -> tuple[list, dict]:
        parts = [part for argument in arguments for part in argument or ()]
        options = {k: v for part in parts if isinstance(part, dict) for k, v in part.items()}
        return [part for part in parts if not isinstance(part, dict)], options

    def instruction(self, name: Token, arguments: tuple[list, dict]) -> Instruction:
        return Instruction(str(name), line_of(name), *arguments)

    def datum(self, name: str, sizes: list | None, value: Any) -> Datum:
        return Datum(str(name), '', value, sizes, is_declared=True)

    def declaration(self, kind: str, *data: Datum) -> Tree:
        return Tree('declaration', [replace(datum, type=str(kind)) for datum in data])

    def parameter(self, optional: str | None, mode: str | None, kind: str, name: str) -> Datum:
        return Datum(str(name), str(kind), optional=optional is not None, shared=mode is not None)

    def parameters(self, *parameters: Datum | None) -> list:
        return [parameter for parameter in parameters if parameter]

    def routine(self, *parts: Any) -> Routine:
        names = [str(part) for part in parts if isinstance(part, str)]
        parameters = next((part for part in parts if isinstance(part, list)), [])
        body = next(part for part in parts if isinstance(part, Tree) and part.data == 'block')
        return Routine(names[-1], parameters, body, '', True)

    def function(self, *parts: Any) -> Routine:
        return self.routine(*parts)._replace(is_procedure=False)

    trap = function


def line_of(token: Token) -> int:
    """Where a word stands; those of a grammar without texts have none."""
    return token.line or 0


def name_of(node: object) -> str:
    """The name that an argument consists of, '' if it is an expression."""
    return str(node.children[0]) if isinstance(node, Tree) and node.data == 'reference' else ''


_grammar = cache(
    partial(Lark.open, 'rapid.lark', rel_to=__file__, parser='lalr', transformer=_Builder())
)


def parse_modules(text: str, source: str) -> list[Module]:
    """The modules in a text.

    Raises:
        RecordingError: it is not RAPID, in one line with source, line and what is wrong there.
    """
    try:
        modules: list[Any] = [*_grammar().parse(text.lower()).children]
    except UnexpectedInput as error:
        token = getattr(error, 'token', None)
        if token is None:
            reason = f'{text.lower()[error.pos_in_stream or 0]!r} is not RAPID'
        else:
            reason = f'{quoted(str(token) or "the end")} is not expected here'
            if 'SEMICOLON' in getattr(error, 'expected', ()):
                reason += "; is a ';' missing before it?"
        raise RecordingError(f'{source} line {error.line}: {reason}') from None
    read = []
    for module in modules:
        name, *scopes = module.children
        found: dict[str, list] = {'global': [], 'local': []}
        for scope in scopes:
            item = scope.children[0]
            if isinstance(item, Routine):
                found[scope.data].append(item._replace(source=source))
            elif isinstance(item, Tree) and item.data == 'declaration':
                found[scope.data] += item.children
        read.append(Module(str(name), source, found['global'], found['local']))
    return read
