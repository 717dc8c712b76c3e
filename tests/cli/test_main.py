"""The command as a whole: help, mistakes, options, progress, and whether it is well installed."""

import ast
import inspect
import io
import json
import os
import shlex
import subprocess
import sys
from contextlib import redirect_stderr
from importlib import metadata
from pathlib import Path

import click
import pytest

import paint_deposition as pd
from booth import SAMPLES
from cli.command import assert_refused, paint
from paint_deposition.cli import results, samples
from paint_deposition.cli.main import COMMANDS
from paint_deposition.cli.main import paint as group
from paint_deposition.cli.results import progress
from paint_deposition.request import MotionOptions, OnePart
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
    with redirect_stderr(terminal), progress('diagnose', after_s=0.0) as show:
        show('fitting the pattern')
        lines = shown(terminal, 3)
        assert lines[-1].startswith('diagnose: fitting the pattern [00:0')
        show('film', 0.25)
        lines = shown(terminal, len(lines) + 3)
    assert lines[-1].startswith('diagnose: film:  25%|')
    # When it is piped nothing is shown.
    pipe = io.StringIO()
    with redirect_stderr(pipe), progress('plan', after_s=0.0) as show:
        show('film', 0.25)
    assert pipe.getvalue() == ''


def test_help_and_the_verb_show_the_fields_of_a_request():
    text = ' '.join(paint('plan', '--help').stdout.split())
    assert '--speed FLOAT RANGE Speed of the passes [m/s]. [0.005<=x<=3.0]' in text
    assert 'Least speed while spraying [m/s]. [default: 0.1; x>0.0]' in text
    assert '--outward X Y Z' in text
    assert '--direction [horizontal|vertical]' in text
    shown = inspect.signature(pd.plan).parameters
    assert list(shown)[:3] == ['surface', 'model', 'frame_id']
    assert shown['direction'].default == 'horizontal'


@pytest.mark.parametrize('kind', [MotionOptions, OnePart])
def test_options_are_the_keys_of_files_in_the_same_words(kind):
    command = group.get_command(click.Context(group), 'simulate')
    helps = {option.name: option.help for option in command.params if option.name}
    for name, field in kind.model_fields.items():
        assert helps[name] == field.description, name


def findings(code: int) -> dict[str, dict]:
    done = paint('doctor', '--json')
    assert (done.returncode, done.stderr) == (code, '')
    told = json.loads(done.stdout)
    assert told['well'] == (done.returncode == 0)
    return {one['name']: one for one in told['findings']}


@pytest.mark.slow
def test_a_complete_installation_is_well():
    middleware = pytest.importorskip('rclpy').get_rmw_implementation_identifier()
    found = findings(0)
    assert f'numpy {metadata.version("numpy")}' in found['libraries']['found'].split(', ')
    assert middleware in found['ROS 2']['found']
    for name in ('libraries', 'known film', 'live = offline'):
        assert found[name]['ok'] is True
    assert not [one for one in found.values() if one['remedy'] and one['ok'] is not None]


@pytest.mark.slow
def test_a_film_that_is_not_the_known_one_is_an_error(monkeypatch):
    monkeypatch.setattr(samples, 'KNOWN_FILM_UM', samples.KNOWN_FILM_UM * (1 + 2e-4))
    found = findings(1)
    assert [one['name'] for one in found.values() if one['ok'] is False] == ['known film']
    assert found['known film']['remedy']


def test_a_library_that_is_missing_or_too_old_is_an_error_unless_an_extra_wants_it(monkeypatch):
    wanted = ['click>=99', 'nowhere>=3', 'numpy', 'elsewhere>=2; extra == "many"']
    monkeypatch.setattr(metadata, 'requires', lambda package: wanted)
    monkeypatch.setattr(samples, '_known_film', lambda: iter(()))
    found = findings(1)
    assert found['libraries']['remedy'] == "pip install 'click>=99' 'nowhere>=3'"
    told = {'ok': None, 'remedy': "pip install 'elsewhere>=2'", 'found': 'elsewhere missing'}
    assert found['extra many'] == told | {'name': 'extra many'}


def test_what_cannot_be_looked_at_is_an_error_with_a_remedy(monkeypatch):
    def broken():
        raise RuntimeError("cannot cache function '_fill': no locator available")

    monkeypatch.setattr(samples, '_known_film', broken)
    done = paint('doctor')
    assert done.returncode == 1
    assert 'BAD broken' in done.stdout
    assert '-> set NUMBA_CACHE_DIR to a folder that can be written' in done.stdout
    assert done.stdout.endswith('paint does not work as it should\n')


def test_no_other_python_takes_a_module_from_the_current_folder(tmp_path, monkeypatch):
    """Those of `doctor` and of `watch --live`: they start from the same list of words."""
    middleware = pytest.importorskip('rclpy').get_rmw_implementation_identifier()
    for name in ('numpy', 'rclpy', 'mine'):
        (tmp_path / f'{name}.py').write_text('open("ran", "w")')
    monkeypatch.chdir(tmp_path)
    ((name, found, *_),) = samples._ros()
    assert name == 'ROS 2'
    assert middleware in found
    command = results.python('import numpy; print(numpy.array(sys.argv[1:]))\nimport mine', 'a')
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.stdout == "['a']\n"
    assert "No module named 'mine'" in done.stderr
    assert not (tmp_path / 'ran').exists()
