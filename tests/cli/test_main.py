"""The command as a whole: help, mistakes, options, progress, its JSON, interruption."""

import ast
import io
import os
import shlex
import subprocess
import sys
from contextlib import redirect_stderr
from pathlib import Path

import click
import pytest

from booth import SAMPLES
from cli.command import assert_refused, paint
from paint_deposition.cli.main import COMMANDS
from paint_deposition.cli.main import paint as group
from paint_deposition.cli.results import Progress
from waiting import until


def python(program: str, **environment: str) -> list[str]:
    """The lines that a new process of Python prints."""
    done = subprocess.run(
        [sys.executable, '-c', program], env=os.environ | environment, capture_output=True,
        text=True, check=True,
    )  # fmt: skip
    return done.stdout.splitlines()


@pytest.mark.parametrize('arguments', [[], ['-h']])
def test_help_lists_every_command_in_a_line(arguments):
    done = paint(*arguments)
    assert (done.returncode, done.stderr) == (0, '')
    listed = done.stdout.split('Commands:\n')[1].splitlines()
    assert [line.split()[0] for line in listed] == list(COMMANDS)


def test_help_comes_at_once():
    """What takes seconds to load is not loaded for it."""
    program = """
import sys
from paint_deposition.cli.main import run
codes = [run(['--help']), run(['--version']), run(['simulate', '--help'])]
slow = {'numpy', 'numba', 'scipy', 'matplotlib', 'rosbags', 'rclpy'}
print('loaded', sorted(slow & set(sys.modules)), codes)
"""
    assert python(program)[-1] == 'loaded [] [0, 0, 0]'


@pytest.mark.parametrize(('typed', 'offered'), [
    ('re', ['recommend', 'refit', 'recover']), ('--v', ['--version']),
    ('plan --fac', ['--faces', '--face-angle-deg']),
])  # fmt: skip
def test_the_shell_completes_commands_and_options(typed, offered):
    line = 'eval "$(_PAINT_COMPLETE=bash_source paint)"'
    words = f'COMP_WORDS=(paint {typed}); COMP_CWORD={len(typed.split())}'
    script = f'{line}; {words}; _paint_completion paint; echo "${{COMPREPLY[@]}}"'
    done = subprocess.run(['bash', '-c', script], capture_output=True, text=True)
    assert (done.stdout.split(), done.stderr) == (offered, '')


def test_completing_a_command_loads_none():
    program = """
import atexit, sys
from paint_deposition.cli.main import run
rooms = lambda: sorted(n for n in sys.modules if n.startswith('paint_deposition.cli.'))
atexit.register(lambda: print(rooms()))
run([])
"""
    typed = {'_PAINT_COMPLETE': 'bash_complete', 'COMP_WORDS': 'paint ', 'COMP_CWORD': '1'}
    *offered, loaded = python(program, **typed)
    assert offered == [f'plain,{name}' for name in COMMANDS]
    assert ast.literal_eval(loaded) == ['paint_deposition.cli.main']


@pytest.mark.parametrize('command', COMMANDS)
def test_every_command_explains_itself(command):
    done = paint(command, '--help')
    assert done.returncode == 0
    assert done.stdout.startswith(f'Usage: paint {command} [OPTIONS]')
    assert '  -h, --help ' in done.stdout
    assert done.stdout.endswith(f'Example:\n    paint {command} {COMMANDS[command][2]}\n')


@pytest.mark.parametrize('name', COMMANDS)
def test_every_example_is_taken_and_begins_with_samples_or_results(name, monkeypatch):
    monkeypatch.chdir(SAMPLES)
    command = group.get_command(click.Context(group), name)
    given = command.make_context(name, shlex.split(COMMANDS[name][2])).params
    assert any(given.values())
    results = {line.split()[-1] for *_, line in COMMANDS.values()}
    for option, value in given.items():
        for path in value if isinstance(value, tuple) else [value]:
            if isinstance(path, Path) and option != 'output':
                own = path.name.startswith('my_')
                assert own or path.exists() or path.parts[0] in results, path


def test_a_command_that_is_none_is_refused_with_the_nearest():
    assert_refused(paint('simulat'), "no command is called 'simulat'", "did you mean 'simulate'?")
    assert_refused(paint('xyz'), 'there are: demo, simulate, ')


def test_no_option_takes_a_number_that_is_none():
    context = click.Context(group)
    numbers = 0
    for name in COMMANDS:
        for option in group.get_command(context, name).params:
            if isinstance(option.type, click.types.FloatParamType | click.FloatRange):
                numbers += 1
                for value in ('nan', 'inf', '-inf'):
                    with pytest.raises(click.BadParameter):
                        option.type.convert(value, option, context)
    assert numbers > 20


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def shown(terminal: Terminal, count: int) -> list[str]:
    """What the line said once it was drawn this often, without another word from the work."""
    until(lambda: terminal.getvalue().count('\r') >= count, f'line {count}')
    return [line.strip() for line in terminal.getvalue().split('\r') if line.strip()]


@pytest.mark.slow
def test_the_clock_runs_within_a_step_and_a_known_share_is_a_bar():
    terminal = Terminal()
    with redirect_stderr(terminal), Progress('diagnose', after_s=0.0) as show:
        show('fitting the pattern')
        lines = shown(terminal, 3)
        assert lines[-1].startswith('diagnose: fitting the pattern [00:0')
        show('film', 0.25)
        lines = shown(terminal, len(lines) + 3)
    assert lines[-1].startswith('diagnose: film:  25%|')


def test_nothing_is_shown_when_piped():
    pipe = io.StringIO()
    with redirect_stderr(pipe), Progress('plan', after_s=0.0) as show:
        show('film', 0.25)
    assert pipe.getvalue() == ''
