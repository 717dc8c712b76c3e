"""ABB RAPID modules as data: declarations, and procedures as lists of instructions.

RAPID ignores case; every name is kept in lower case here. Blocks (IF, FOR, WHILE, TEST) are not
executed: an instruction inside one knows it, so that a reader can refuse what it cannot follow.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from paint_deposition.files.rapid.values import ValueParser

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
    type: str
    value: object
    line: int


@dataclass
class Module:
    """A module's own declarations, and its procedures with their local ones."""

    name: str
    data: dict[str, Declaration] = field(default_factory=dict)
    procedures: dict[str, list[Instruction]] = field(default_factory=dict)


class ModuleParser(ValueParser):
    """Reads a module; refuses, with the line, where RAPID ends and something else begins."""

    # --- declarations and procedures

    def module(self) -> Module:
        """The whole module."""
        self._expect('module')
        module = Module(self._name())
        if self._takes('('):
            self._skip_past(')')
        while not self._takes('endmodule'):
            self._member(module)
        return module

    def _member(self, module: Module) -> None:
        while self._takes('local', 'task'):
            pass
        word = self._now.word
        if self._takes(*STORAGE):
            self._declaration(module.data)
        elif self._takes('proc'):
            self._procedure(module)
        elif word in SKIPPED_TO:
            self._skip_past(SKIPPED_TO[word])
        else:
            self._fail(f'{self._now.text or "the end"!r} is no declaration')

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
