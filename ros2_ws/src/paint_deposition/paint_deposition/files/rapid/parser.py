"""ABB RAPID modules as data: declarations, and procedures as lists of instructions.

RAPID ignores case; every name is kept in lower case here. Blocks (IF, FOR, WHILE, TEST) are not
executed: an instruction inside one knows it, so that a reader can refuse what it cannot follow.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple, NoReturn

from paint_deposition.errors import RecordingError

# Backups begin with a block of controller information between %%%.
TOKEN = re.compile(
    r"""
    (?P<space>\A\s*%%%(?s:.*?)%%%|\s+|!.*|%%%)
  | (?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)
  | (?P<string>"(?:[^"\n]|"")*")
  | (?P<name>[A-Za-z_]\w*)
  | (?P<symbol>:=|<=|>=|<>|[][(){},;:\\+\-*/=<>.?])
  | (?P<strange>.)
    """,
    re.VERBOSE,
)
# Operators, and how strongly they bind the values beside them.
BINDING = {
    '=': 0, '<': 0, '>': 0, '<=': 0, '>=': 0, '<>': 0, 'and': 0, 'or': 0, 'xor': 0, 'div': 0,
    'mod': 0, '+': 1, '-': 1, '*': 2, '/': 2,
}  # fmt: skip


class Token(NamedTuple):
    kind: str
    text: str
    line: int

    @property
    def word(self) -> str:
        """The text as RAPID compares it, without case; texts of strings keep their quotes."""
        return self.text.lower()


class Reference(NamedTuple):
    """A datum by name, with the indexes and components that follow it."""

    name: str
    indexes: tuple = ()
    components: tuple = ()


class Call(NamedTuple):
    """A function of values, or an operator: `offs`, '+', '-', '*', '/'."""

    function: str
    arguments: list
    options: dict


def tokens(text: str, source: str) -> Iterator[Token]:
    line = 1
    for match in TOKEN.finditer(text):
        if match.lastgroup == 'strange':
            raise RecordingError(f'{source} line {line}: {match[0]!r} is not RAPID')
        if match.lastgroup != 'space':
            yield Token(str(match.lastgroup), match[0], line)
        line += match[0].count('\n')
    yield Token('end', '', line)


STORAGE = ('const', 'pers', 'var')
BLOCK_END = {'if': 'endif', 'for': 'endfor', 'while': 'endwhile', 'test': 'endtest'}
HEADER_END = {
    'else': 'else', 'elseif': 'then', 'case': ':', 'default': ':', 'for': 'do', 'while': 'do',
}  # fmt: skip
SKIPPED_TO = {'func': 'endfunc', 'trap': 'endtrap', 'record': 'endrecord', 'alias': ';'}
HANDLERS = ('error', 'undo', 'backward')


@dataclass(frozen=True)
class Instruction:
    """`name value, ...;` with options, or an assignment `:=` of the second value to the first."""

    name: str
    values: list
    options: dict
    line: int
    block: str = ''


@dataclass(frozen=True)
class Declaration:
    """A datum's type, its value, None where there is none, and the line that declares it."""

    type: str
    value: object
    line: int


@dataclass
class Module:
    """A module's own declarations, and its procedures with their local ones."""

    name: str
    data: dict[str, Declaration] = field(default_factory=dict)
    procedures: dict[str, list[Instruction]] = field(default_factory=dict)


class ModuleParser:
    """Reads a module; refuses, with the line, where RAPID ends and something else begins."""

    def __init__(self, text: str, source: str) -> None:
        self._tokens = list(tokens(text, source))
        self._at = 0
        self._source = source

    @property
    def _now(self) -> Token:
        return self._tokens[self._at]

    def _next(self) -> Token:
        token = self._now
        self._at += token.kind != 'end'
        return token

    def _takes(self, *words: str) -> bool:
        taken = self._now.word in words
        if taken:
            self._next()
        return taken

    def _expect(self, word: str) -> None:
        if not self._takes(word):
            self._fail(f'{word!r} expected, found {self._now.text or "the end"!r}')

    def _name(self, what: str = 'a name') -> str:
        if self._now.kind != 'name':
            self._fail(f'{what} expected, found {self._now.text or "the end"!r}')
        return self._next().word

    def _skip_past(self, word: str) -> None:
        while not self._takes(word):
            if self._next().kind == 'end':
                self._fail(f'{word} expected before the end')

    def _fail(self, reason: str) -> NoReturn:
        raise RecordingError(f'{self._source} line {self._now.line}: {reason}')

    # --- values

    def _expression(self, least_binding: int = 0) -> object:
        value = self._operand()
        while BINDING.get(self._now.word, -1) >= least_binding:
            operator = self._next().word
            value = Call(operator, [value, self._expression(BINDING[operator] + 1)], {})
        return value

    def _operand(self) -> object:
        if self._takes('-'):
            value = self._operand()
            return -value if isinstance(value, float) else Call('-', [0.0, value], {})
        if self._takes('+'):
            return self._operand()
        if self._takes('not'):
            return Call('not', [self._operand()], {})
        if self._takes('['):
            return self._arguments(']')[0]
        if self._takes('('):
            value = self._expression()
            self._expect(')')
            return value
        if self._now.kind == 'number':
            return float(self._next().text)
        if self._now.kind == 'string':
            return self._next().text[1:-1].replace('""', '"')
        name = self._name('a value')
        if name in ('true', 'false'):
            return name == 'true'
        if self._takes('('):
            return Call(name, *self._arguments(')'))
        return self._reference(name)

    def _arguments(self, end: str) -> tuple[list, dict]:
        """Values up to `end`, which is taken too, and options: True for a mere switch."""
        values: list = []
        options: dict = {}
        if self._takes(end):
            return values, options
        while True:
            # Options come behind their argument, or before the first one.
            if self._now.text != '\\':
                values.append(self._expression())
            while end in (')', ';') and self._takes('\\'):
                name = self._name()
                options[name] = self._expression() if self._takes(':=') else True
            if not self._takes(','):
                self._expect(end)
                return values, options

    def _reference(self, name: str) -> Reference:
        indexes = self._arguments('}')[0] if self._takes('{') else []
        components = []
        while self._takes('.'):
            components.append(self._name())
        return Reference(name, tuple(indexes), tuple(components))

    # --- declarations and procedures

    def module(self) -> Module:
        """The whole module."""
        self._expect('module')
        module = Module(self._name())
        if self._takes('('):
            self._skip_past(')')
        while not self._takes('endmodule'):
            word = self._now.word
            if self._takes(*STORAGE):
                self._declaration(module.data)
            elif self._takes('proc'):
                self._procedure(module)
            elif word in SKIPPED_TO:
                self._skip_past(SKIPPED_TO[word])
            elif not self._takes('local', 'task'):
                self._fail(f'{self._now.text or "the end"!r} is no declaration')
        return module

    def _declaration(self, data: dict[str, Declaration]) -> None:
        line, kind = self._now.line, self._name()
        while True:
            name = self._name()
            if self._takes('{'):
                self._skip_past('}')
            value = self._expression() if self._takes(':=') else None
            data[name] = Declaration(kind, value, line)
            if not self._takes(','):
                break
        self._expect(';')

    def _procedure(self, module: Module) -> None:
        name = self._name()
        self._expect('(')
        self._skip_past(')')
        body: list[Instruction] = []
        module.procedures[name] = body
        blocks: list[str] = []
        while not self._takes('endproc'):
            if self._takes(*STORAGE):
                self._declaration(module.data)
            elif self._now.word in HANDLERS and not blocks:
                self._skip_past('endproc')
                break
            else:
                self._statement(blocks, body)

    # --- statements

    def _statement(self, blocks: list[str], body: list[Instruction]) -> None:
        word = self._now.word
        if blocks and self._takes(BLOCK_END[blocks[-1]]):
            blocks.pop()
            self._takes(';')
        elif word in HEADER_END:
            if word in BLOCK_END:
                blocks.append(word)
            self._skip_past(HEADER_END[word])
        elif self._takes('if', 'test'):
            self._expression()
            if word == 'if' and not self._takes('then'):
                body.append(self._instruction('if'))  # the compact form
            else:
                blocks.append(word)
        elif self._now.kind == 'name' and self._tokens[self._at + 1].text == ':':
            self._at += 2  # a label
        else:
            body.append(self._instruction(blocks[-1] if blocks else ''))

    def _instruction(self, block: str) -> Instruction:
        line = self._now.line
        target = self._reference(self._name())
        if self._takes(':='):
            value = self._expression()
            self._expect(';')
            return Instruction(':=', [target, value], {}, line, block)
        return Instruction(target.name, *self._arguments(';'), line, block)
