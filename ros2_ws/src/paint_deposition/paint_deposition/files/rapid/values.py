"""Tokens and values of ABB RAPID: numbers, texts, aggregates, names and simple expressions."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from paint_deposition.errors import RecordingError

TOKEN = re.compile(
    r"""
    (?P<space>\s+|!.*|%%%)
  | (?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)
  | (?P<string>"(?:[^"\n]|"")*")
  | (?P<name>[A-Za-z_]\w*)
  | (?P<symbol>:=|<=|>=|<>|[][(){},;:\\+\-*/=<>.?])
    """,
    re.VERBOSE,
)
COMPARISONS = ('=', '<', '>', '<=', '>=', '<>', 'and', 'or', 'xor', 'div', 'mod')


class Token(NamedTuple):
    kind: str
    text: str
    line: int


class Reference(NamedTuple):
    """A datum by name, with the indexes and components that follow it."""

    name: str
    indexes: tuple = ()
    components: tuple = ()


class Call(NamedTuple):
    """A function of values, or an operator: `offs`, '+', '-', '*', '/'."""

    function: str
    arguments: tuple
    options: tuple[str, ...] = ()


@dataclass(frozen=True)
class Argument:
    """A positional argument, and the options behind it: values by name, True for a mere switch."""

    value: object
    options: dict = field(default_factory=dict)


def tokens(text: str, source: str) -> Iterator[Token]:
    line, position = 1, 0
    # Backups begin with a block of controller information.
    header = re.match(r'\s*%%%.*?%%%', text, re.DOTALL)
    if header:
        position, line = header.end(), 1 + header[0].count('\n')
    while position < len(text):
        match = TOKEN.match(text, position)
        if match is None:
            raise RecordingError(f'{source} line {line}: {text[position]!r} is not RAPID')
        if match.lastgroup != 'space':
            yield Token(str(match.lastgroup), match[0], line)
        line += match[0].count('\n')
        position = match.end()
    yield Token('end', '', line)


class ValueParser:
    """Reads tokens one after the other; `source` names them in errors."""

    def __init__(self, text: str, source: str) -> None:
        self._tokens = list(tokens(text, source))
        self._at = 0
        self._source = source

    # --- tokens

    @property
    def _now(self) -> Token:
        return self._tokens[self._at]

    def _next(self) -> Token:
        token = self._now
        self._at += token.kind != 'end'
        return token

    def _word(self) -> str:
        """The name that comes next in lower case, '' if something else comes."""
        return self._now.text.lower() if self._now.kind == 'name' else ''

    def _takes(self, text: str) -> bool:
        if self._now.kind != 'string' and self._now.text.lower() == text:
            self._next()
            return True
        return False

    def _expect(self, text: str) -> None:
        if not self._takes(text):
            self._fail(f'{text!r} expected, found {self._now.text or "the end"!r}')

    def _name(self) -> str:
        if self._now.kind != 'name':
            self._fail(f'a name expected, found {self._now.text or "the end"!r}')
        return self._next().text.lower()

    def _skip_past(self, *texts: str) -> None:
        while self._now.kind != 'end':
            if self._next().text.lower() in texts:
                return
        self._fail(f'{texts[-1]} expected before the end')

    def _fail(self, reason: str) -> None:
        raise RecordingError(f'{self._source} line {self._now.line}: {reason}')

    # --- values

    def _expression(self) -> object:
        value = self._product()
        while self._now.text in ('+', '-'):
            value = Call(self._next().text, (value, self._product()))
        while self._now.text.lower() in COMPARISONS and self._now.kind != 'string':
            value = Call(self._next().text.lower(), (value, self._product()))
        return value

    def _product(self) -> object:
        value = self._unary()
        while self._now.text in ('*', '/'):
            value = Call(self._next().text, (value, self._unary()))
        return value

    def _unary(self) -> object:
        if self._takes('-'):
            value = self._unary()
            return -value if isinstance(value, float) else Call('-', (0.0, value))
        if self._takes('+'):
            return self._unary()
        if self._takes('not'):
            return Call('not', (self._unary(),))
        return self._primary()

    def _primary(self) -> object:
        token = self._now
        if token.kind == 'number':
            return float(self._next().text)
        if token.kind == 'string':
            return self._next().text[1:-1].replace('""', '"')
        if self._takes('['):
            return self._listed(']')
        if self._takes('('):
            value = self._expression()
            self._expect(')')
            return value
        if token.kind != 'name':
            self._fail(f'a value expected, found {token.text or "the end"!r}')
        if self._word() in ('true', 'false'):
            return self._next().text.lower() == 'true'
        if self._tokens[self._at + 1].text == '(':
            name = self._name()
            self._next()
            arguments = self._arguments(')')
            options = tuple(option for argument in arguments for option in argument.options)
            return Call(name, tuple(argument.value for argument in arguments), options)
        return self._reference()

    def _listed(self, end: str) -> list:
        values: list = []
        if self._takes(end):
            return values
        while True:
            values.append(self._expression())
            if not self._takes(','):
                self._expect(end)
                return values

    def _arguments(self, end: str) -> tuple[Argument, ...]:
        """Arguments up to `end`, which is taken too."""
        arguments: list[Argument] = []
        while self._now.text != end:
            # Options come behind their argument, or before the first one.
            value = None if self._now.text == '\\' else self._expression()
            arguments.append(Argument(value, self._options()))
            if not self._takes(','):
                break
        self._expect(end)
        return tuple(arguments)

    def _options(self) -> dict:
        options = {}
        while self._takes('\\'):
            name = self._name()
            options[name] = self._expression() if self._takes(':=') else True
        return options

    def _reference(self) -> Reference:
        name, indexes, components = self._name(), (), []
        if self._takes('{'):
            indexes = tuple(self._listed('}'))
        while self._takes('.'):
            components.append(self._name())
        return Reference(name, indexes, tuple(components))
