"""ABB RAPID modules as data: declarations, and procedures as lists of instructions.

RAPID ignores case: names are converted to lower case. Blocks (IF, FOR, WHILE, TEST) are not
evaluated; an instruction inside one names it, so that the interpreter can refuse it.
"""

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
  | (?P<unknown>.)
    """,
    re.VERBOSE,
)
# Precedence of the operators.
PRECEDENCE = {
    '=': 0, '<': 0, '>': 0, '<=': 0, '>=': 0, '<>': 0, 'and': 0, 'or': 0, 'xor': 0, 'div': 0,
    'mod': 0, '+': 1, '-': 1, '*': 2, '/': 2,
}  # fmt: skip


class Token(NamedTuple):
    kind: str
    text: str
    line: int

    @property
    def word(self) -> str:
        """The text in lower case, for comparisons; strings keep their quotes."""
        return self.text.lower()


class Reference(NamedTuple):
    """A reference to a datum by name, with indexes and components."""

    name: str
    indexes: tuple = ()
    components: tuple = ()


class Call(NamedTuple):
    """A call of a function or operator: `offs`, '+', '-', '*', '/'."""

    function: str
    arguments: list
    options: dict


def tokenize(text: str, source: str) -> Iterator[Token]:
    line = 1
    for match in TOKEN.finditer(text):
        if match.lastgroup == 'unknown':
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
SKIPPED_UNTIL = {'func': 'endfunc', 'trap': 'endtrap', 'record': 'endrecord', 'alias': ';'}
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
    """The type, value (None without one) and line of a declared datum."""

    type: str
    value: object
    line: int


@dataclass
class Module:
    """The declarations of a module, local ones included, and its procedures."""

    name: str
    data: dict[str, Declaration] = field(default_factory=dict)
    procedures: dict[str, list[Instruction]] = field(default_factory=dict)


class ModuleParser:
    """A recursive-descent parser of a module; errors name the line."""

    def __init__(self, text: str, source: str) -> None:
        self._tokens = list(tokenize(text, source))
        self._index = 0
        self._source = source

    @property
    def _current(self) -> Token:
        return self._tokens[self._index]

    def _advance(self) -> Token:
        token = self._current
        self._index += token.kind != 'end'
        return token

    def _accept(self, *words: str) -> bool:
        taken = self._current.word in words
        if taken:
            self._advance()
        return taken

    def _expect(self, word: str) -> None:
        if not self._accept(word):
            self._fail(f'{word!r} expected, found {self._current.text or "the end"!r}')

    def _expect_name(self, what: str = 'a name') -> str:
        if self._current.kind != 'name':
            self._fail(f'{what} expected, found {self._current.text or "the end"!r}')
        return self._advance().word

    def _skip_past(self, word: str) -> None:
        while not self._accept(word):
            if self._advance().kind == 'end':
                self._fail(f'{word} expected before the end')

    def _fail(self, reason: str) -> NoReturn:
        raise RecordingError(f'{self._source} line {self._current.line}: {reason}')

    # --- values

    def _parse_expression(self, min_precedence: int = 0) -> object:
        value = self._parse_operand()
        while PRECEDENCE.get(self._current.word, -1) >= min_precedence:
            operator = self._advance().word
            value = Call(operator, [value, self._parse_expression(PRECEDENCE[operator] + 1)], {})
        return value

    def _parse_operand(self) -> object:
        if self._accept('-'):
            value = self._parse_operand()
            return -value if isinstance(value, float) else Call('-', [0.0, value], {})
        if self._accept('+'):
            return self._parse_operand()
        if self._accept('not'):
            return Call('not', [self._parse_operand()], {})
        if self._accept('['):
            return self._parse_arguments(']')[0]
        if self._accept('('):
            value = self._parse_expression()
            self._expect(')')
            return value
        if self._current.kind == 'number':
            return float(self._advance().text)
        if self._current.kind == 'string':
            return self._advance().text[1:-1].replace('""', '"')
        name = self._expect_name('a value')
        if name in ('true', 'false'):
            return name == 'true'
        if self._accept('('):
            return Call(name, *self._parse_arguments(')'))
        return self._parse_reference(name)

    def _parse_arguments(self, end: str) -> tuple[list, dict]:
        """Values and options up to and including `end`; an option without a value is True."""
        values: list = []
        options: dict = {}
        if self._accept(end):
            return values, options
        while True:
            # Options follow their argument, or precede the first one.
            if self._current.text != '\\':
                values.append(self._parse_expression())
            while end in (')', ';') and self._accept('\\'):
                name = self._expect_name()
                options[name] = self._parse_expression() if self._accept(':=') else True
            if not self._accept(','):
                self._expect(end)
                return values, options

    def _parse_reference(self, name: str) -> Reference:
        indexes = self._parse_arguments('}')[0] if self._accept('{') else []
        components = []
        while self._accept('.'):
            components.append(self._expect_name())
        return Reference(name, tuple(indexes), tuple(components))

    # --- declarations and procedures

    def module(self) -> Module:
        """Parse the module."""
        self._expect('module')
        module = Module(self._expect_name())
        if self._accept('('):
            self._skip_past(')')
        while not self._accept('endmodule'):
            word = self._current.word
            if self._accept(*STORAGE):
                self._parse_declaration(module.data)
            elif self._accept('proc'):
                self._parse_procedure(module)
            elif word in SKIPPED_UNTIL:
                self._skip_past(SKIPPED_UNTIL[word])
            elif not self._accept('local', 'task'):
                self._fail(f'{self._current.text or "the end"!r} is no declaration')
        return module

    def _parse_declaration(self, data: dict[str, Declaration]) -> None:
        line, kind = self._current.line, self._expect_name()
        while True:
            name = self._expect_name()
            if self._accept('{'):
                self._skip_past('}')
            value = self._parse_expression() if self._accept(':=') else None
            data[name] = Declaration(kind, value, line)
            if not self._accept(','):
                break
        self._expect(';')

    def _parse_procedure(self, module: Module) -> None:
        name = self._expect_name()
        self._expect('(')
        self._skip_past(')')
        body: list[Instruction] = []
        module.procedures[name] = body
        blocks: list[str] = []
        while not self._accept('endproc'):
            if self._accept(*STORAGE):
                self._parse_declaration(module.data)
            elif self._current.word in HANDLERS and not blocks:
                self._skip_past('endproc')
                break
            else:
                self._parse_statement(blocks, body)

    # --- statements

    def _parse_statement(self, blocks: list[str], body: list[Instruction]) -> None:
        word = self._current.word
        if blocks and self._accept(BLOCK_END[blocks[-1]]):
            blocks.pop()
            self._accept(';')
        elif word in HEADER_END:
            if word in BLOCK_END:
                blocks.append(word)
            self._skip_past(HEADER_END[word])
        elif self._accept('if', 'test'):
            self._parse_expression()
            if word == 'if' and not self._accept('then'):
                body.append(self._parse_instruction('if'))  # the compact form
            else:
                blocks.append(word)
        elif self._current.kind == 'name' and self._tokens[self._index + 1].text == ':':
            self._index += 2  # a label
        else:
            body.append(self._parse_instruction(blocks[-1] if blocks else ''))

    def _parse_instruction(self, block: str) -> Instruction:
        line = self._current.line
        target = self._parse_reference(self._expect_name())
        if self._accept(':='):
            value = self._parse_expression()
            self._expect(';')
            return Instruction(':=', [target, value], {}, line, block)
        return Instruction(target.name, *self._parse_arguments(';'), line, block)
