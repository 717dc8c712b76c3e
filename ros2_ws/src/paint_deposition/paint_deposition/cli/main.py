"""The command `paint`: simulate, measure up, find what is missing, plan."""

import importlib
import os
import signal
import sys

import click
from click.shell_completion import CompletionItem

from paint_deposition import __version__, git_version
from paint_deposition.errors import PaintError, did_you_mean

# As fitting/one_thread.py does for the fits of a script, here for all that a command computes; to
# be set before NumPy is loaded.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

# Of each command: the module with its function, COMMAND_command; what the list of commands says;
# an example, as it runs in the folder of the samples. Modules are only loaded when their command
# is used, so that help comes at once.
COMMANDS = {
    'demo': ('samples', 'Paint, diagnose and improve a sample door, on one page.',
        '-o my_demo'),
    'simulate': ('simulate', 'Film on a part from a recorded trajectory.',
        '--mesh door.stl --trajectory door_horizontal --trigger /atomizer/state -o film'),
    'calibrate': ('inference', "Fit the bell's pattern to gauge readings.",
        'panel_study/campaign.yaml -o bell'),
    'recommend': ('planning', 'Recommend the index between passes.',
        '--model bell/model.yaml --target-um 20 -o index'),
    'plan': ('planning', 'Lay passes over a part; write bag, CSV and RAPID module.',
        '--mesh door.stl --model bell/model.yaml --target-um 20 -o passes'),
    'improve': ('planning', 'Make the film of a programme more even: speeds, flows, triggers.',
        '--mesh door.stl --trajectory passes/trajectory --model found/model.yaml -o better'),
    'measure': ('simulate', 'Choose where to put the gauge on a part.',
        '--mesh door.stl --trajectory door_horizontal --points 40 -o points'),
    'compare': ('inference', 'Compare the model with gauge readings.',
        'measured_door/campaign.yaml --model bell/model.yaml -o compared'),
    'diagnose': ('inference', 'Find which effect the model lacks; add it.',
        'measured_door/campaign.yaml --model bell/model.yaml -o found'),
    'refit': ('inference', 'Add an effect of your choice and refit.',
        'measured_door/campaign.yaml --add incidence_attraction -o refitted'),
    'sweep': ('simulate', 'Compute many variations of one job, on all cores or a cluster.',
        'my_sweep.yaml -o swept'),
    'place': ('planning', 'Find where the part may stand for the robot to drive all passes.',
        '--trajectory passes/passes.mod --urdf my_arm.urdf --part-pose 2 0 0 0 0 0 1 -o map'),
    'locate': ('simulate', 'Find the pose of the part from touched points.',
        '--touched my_touched.csv --points my_points.csv'),
    'watch': ('runs', 'Show a run or a live cell on a page in 3D.',
        'door_horizontal --mesh door.stl --trigger /atomizer/state'),
    'view': ('runs', 'Open a recorded run in Rerun, where that is installed.',
        'door_horizontal'),
    'inspect': ('inspect', 'Show what a recording holds, or how the gun ran over a part.',
        'door_horizontal --mesh door.stl --out door.png'),
    'recover': ('runs', 'Recover an unfinished run as a complete bag.',
        'my_broken_run -o recovered'),
    'doctor': ('samples', 'Say what is installed, and test it.',
        '--json'),
}  # fmt: skip


class Commands(click.Group):
    """The commands above, loaded when used."""

    def list_commands(self, context: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, context: click.Context, name: str) -> click.Command:
        if name not in COMMANDS:
            remedy = did_you_mean(name, COMMANDS)
            raise click.UsageError(f'no command is called {name!r}; {remedy}')
        module = importlib.import_module(f'paint_deposition.cli.{COMMANDS[name][0]}')
        command: click.Command = getattr(module, f'{name}_command')
        command.epilog = f'\b\nExample:\n  paint {name} {COMMANDS[name][2]}'
        return command

    def shell_complete(self, context: click.Context, incomplete: str) -> list[CompletionItem]:
        """Commands without loading their modules, all of which together take a second."""
        commands = [
            CompletionItem(name, help=summary)
            for name, (_, summary, _) in COMMANDS.items()
            if name.startswith(incomplete)
        ]
        return commands + click.Command.shell_complete(self, context, incomplete)

    def format_commands(self, context: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section('Commands'):
            formatter.write_dl([(name, summary) for name, (_, summary, _) in COMMANDS.items()])


@click.group(
    cls=Commands,
    invoke_without_command=True,
    context_settings={'help_option_names': ['-h', '--help'], 'max_content_width': 100},
)
@click.option('--version', 'shows_version', is_flag=True, help='Show the version and exit.')
@click.pass_context
def paint(context: click.Context, shows_version: bool) -> None:
    """Film build of robotic bells: from recordings and gauge readings to a model that fits.

    Lengths are in metres, film in micrometres. `paint COMMAND --help` says more.
    """
    if shows_version:
        click.echo(f'paint {__version__} {git_version()}'.rstrip())
        context.exit()
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


def main(arguments: list[str] | None = None) -> None:
    """Run a command: exit code 0, 2 with one line on stderr for bad input, 130 for Ctrl-C.

    SIGTERM and SIGHUP end a command as Ctrl-C does, unless they are ignored, as under nohup.
    """
    for name in ('SIGTERM', 'SIGHUP'):
        number = getattr(signal, name, None)
        if number and signal.getsignal(number) == signal.SIG_DFL:
            signal.signal(number, _interrupt)
    sys.exit(run(arguments))


def _interrupt(number: int, frame: object) -> None:
    signal.signal(number, signal.SIG_IGN)  # a second one does not disturb the tidying up
    raise KeyboardInterrupt


def run(arguments: list[str] | None = None) -> int:
    """Run a command and return its exit code."""
    exit_code = 2
    try:
        # The result of a command, or the code with which it has ended itself.
        done = paint.main(args=arguments, prog_name='paint', standalone_mode=False)
        return done if isinstance(done, int) else 0
    except PaintError as error:
        text = str(error)
    except click.ClickException as error:
        text = error.format_message()
    except OSError as error:
        text = f'{error.filename or "output"}: {error.strerror or error}'
    except MemoryError:
        text = 'there is not enough memory; give smaller files, or a machine with more'
    except (click.Abort, KeyboardInterrupt):
        text, exit_code = 'interrupted', 130
    click.echo(f'paint: {" ".join(text.split())}', err=True)
    return exit_code


if __name__ == '__main__':
    main()
