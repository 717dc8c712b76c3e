"""ABB RAPID modules as data: declarations, and procedures as lists of instructions.

RAPID ignores case; every name is kept in lower case here. Blocks (IF, FOR, WHILE, TEST) are not
executed: an instruction inside one knows it, so that a reader can refuse what it cannot follow.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from paint_deposition.files.rapid.values import Argument, ValueParser

STORAGE = ('const', 'pers', 'var')
BLOCK_END = {'if': 'endif', 'for': 'endfor', 'while': 'endwhile', 'test': 'endtest'}
HEADER_END = {'if': 'then', 'elseif': 'then', 'for': 'do', 'while': 'do'}
HANDLERS = ('error', 'undo', 'backward')


@dataclass(frozen=True)
class Instruction:
    """`name argument, ...;`, or an assignment, whose name is ':=' and whose target is a value."""

    name: str
    arguments: tuple[Argument, ...]
    line: int
    block: str = ''

    def options(self) -> dict:
        """The options of all arguments together."""
        merged: dict = {}
        for argument in self.arguments:
            merged |= argument.options
        return merged


@dataclass(frozen=True)
class Declaration:
    type: str
    value: object
    line: int


@dataclass
class Module:
    """A module's own declarations, and its procedures with their local ones."""

    name: str
    data: dict[str, Declaration] = field(default_factory=dict)
    procedures: dict[str, list[Instruction]] = field(default_factory=dict)


def parse_module(text: str, source: str = 'module') -> Module:
    """Parse a module; `source` names it in errors.

    Raises RecordingError with the line where RAPID ends and something else begins.
    """
    return _Parser(text, source).module()


class _Parser(ValueParser):
    # --- declarations and procedures

    def module(self) -> Module:
        self._expect('module')
        module = Module(self._name())
        if self._takes('('):
            self._skip_past(')')
        while not self._takes('endmodule'):
            self._member(module)
        return module

    def _member(self, module: Module) -> None:
        while self._word() in ('local', 'task'):
            self._next()
        word = self._word()
        if word in STORAGE:
            self._declaration(module.data)
        elif word == 'proc':
            self._procedure(module)
        elif word in ('func', 'trap', 'record'):
            self._skip_past(f'end{word}')
        elif word == 'alias':
            self._skip_past(';')
        else:
            self._fail(f'{self._now.text or "the end"!r} is no declaration')

    def _declaration(self, data: dict[str, Declaration]) -> None:
        self._next()
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
        self._next()
        name = self._name()
        self._expect('(')
        self._skip_past(')')
        body: list[Instruction] = []
        blocks: list[str] = []
        while not self._takes('endproc'):
            word = self._word()
            if word in HANDLERS and not blocks:
                self._skip_past('endproc')
                break
            if word in STORAGE:
                self._declaration(module.data)
            else:
                body += self._statement(blocks)
        module.procedures[name] = body

    # --- statements

    def _statement(self, blocks: list[str]) -> list[Instruction]:
        word = self._word()
        if blocks and word == BLOCK_END[blocks[-1]]:
            self._next()
            blocks.pop()
            self._takes(';')
        elif word in ('else', 'elseif', 'case', 'default'):
            self._skip_past({'else': 'else', 'elseif': 'then'}.get(word, ':'))
        elif word == 'if':
            return self._if(blocks)
        elif word in BLOCK_END:
            blocks.append(word)
            self._next()
            if word == 'test':
                self._expression()
            else:
                self._skip_past(HEADER_END[word])
        elif self._now.kind == 'name' and self._tokens[self._at + 1].text == ':':
            self._at += 2  # a label
        else:
            return [self._instruction(blocks[-1] if blocks else '')]
        return []

    def _if(self, blocks: list[str]) -> list[Instruction]:
        """A block, or the compact form: a condition and one instruction without THEN."""
        self._next()
        self._expression()
        if self._takes('then'):
            blocks.append('if')
            return []
        return [self._instruction('if')]

    def _instruction(self, block: str) -> Instruction:
        line = self._now.line
        if self._takes('%'):
            self._fail('late binding is not read')
        target = self._reference()
        if self._takes(':='):
            value = Argument(self._expression())
            self._expect(';')
            return Instruction(':=', (Argument(target), value), line, block)
        arguments = self._arguments(';')
        return Instruction(target.name, arguments, line, block)
