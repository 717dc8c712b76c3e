"""The commands with their options, from the click tree."""

from inspect import cleandoc

import click

from generated.markdown import code, definitions
from paint_deposition.cli.main import COMMANDS, paint


def text() -> str:
    """A section for each command, in the order of `paint --help`."""
    parent = click.Context(paint, info_name='paint')
    return '\n'.join(_section(name, parent) for name in COMMANDS)


def _section(name: str, parent: click.Context) -> str:
    command = paint.get_command(parent, name)
    context = click.Context(command, info_name=name, parent=parent)
    usage = ' '.join([context.command_path, *command.collect_usage_pieces(context)])
    records = (p.get_help_record(context) for p in command.get_params(context) if p.name != 'help')
    options = definitions((names, help_text) for names, help_text in filter(None, records))
    parts = [f'## {context.command_path}\n', code(usage), cleandoc(command.help or ''), '']
    if command.epilog:  # an example; \b keeps click from wrapping it
        parts += [code(cleandoc(command.epilog.replace('\b\n', '')), 'bash'), '']
    return '\n'.join([*parts, options])
