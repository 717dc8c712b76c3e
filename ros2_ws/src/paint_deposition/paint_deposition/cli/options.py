"""What several commands take and say alike: numbers, options, inputs and results."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import paint_deposition as pd
from paint_deposition.cli.results_folder import results_in

if TYPE_CHECKING:
    import numpy as np

    from paint_deposition.film.statistics import FilmStatistics
    from paint_deposition.part.zones import Zones


class FiniteRange(click.FloatRange):
    """A finite number, within bounds if there are any; else it says what is wanted."""

    def __init__(self, *ends: Any, **bounds: Any) -> None:
        super().__init__(*ends, **bounds)
        self.name = 'float range' if ends or bounds else 'float'

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        try:
            number = super().convert(value, param, ctx)
            if not math.isfinite(number):  # `nan` and `inf` are numbers to Python
                raise click.BadParameter(f'{value} is not finite; give a number', ctx, param)
        except click.BadParameter as error:
            if not isinstance(param, click.Option) or not param.help:
                raise
            metres = ', in metres' if str(param.name).endswith('_m') else ''
            words = f'{error.message.rstrip(".")}{metres}; wanted: {param.help.rstrip(".")}'
            raise click.BadParameter(words, ctx, param) from None
        return number


class File(click.Path):
    """A path that is not empty, as that of a variable of the shell which is not set."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if value == '':
            name = param.opts[0] if param else 'the path'
            raise click.UsageError(f'{name} is empty; give a file', ctx)
        return super().convert(value, param, ctx)


NUMBER = FiniteRange()
POSITIVE = FiniteRange(min=0.0, min_open=True)
NOT_NEGATIVE = FiniteRange(min=0.0)
FILE = File(path_type=Path)
FOLDER = click.Path(path_type=Path, file_okay=False)
JSON = click.option('--json', 'as_json', is_flag=True, help='Print the figures as JSON.')
CAMPAIGN = click.argument('campaign', type=FILE)


POINTS = click.option(
    '--points', 'points_file', type=FILE,
    help='Measuring points, label and x, y, z, of readings that name their point only.',
)  # fmt: skip


ZONES = click.option(
    '--zones', 'zones_file', type=FILE,
    help='Regions of the part with a target and a tolerance of their own, YAML; elsewhere '
    '--target-um holds.',
)  # fmt: skip


def zones_of(zones_file: Path | None, part: Mapping[str, Any]) -> Zones | None:
    """The zones of a part, which is given as for ``part_options``."""
    if zones_file is None:
        return None
    return pd.read_zones(zones_file, part['path'], part['scale'], part['body'])


def zone_lines(
    now: Mapping[str, FilmStatistics], before: Mapping[str, FilmStatistics] | None = None
) -> Iterator[str]:
    """The film on each zone by its name, and what it was before."""
    for name, zone in now.items():
        was = before and before[name]
        bare = f', {100 * (1.0 - zone.coverage):.1f} % of it bare' if zone.coverage < 1.0 else ''
        yield (
            f'{name}, {zone.target_um:g} ± {zone.target_tolerance_um:g} µm: '
            f'{f"{was.mean_um:.1f} → " if was else ""}{zone.mean_um:.1f} µm mean, '
            f'{zone.min_um:.1f} to {zone.max_um:.1f} µm, '
            f'{f"{100 * was.within_target:.1f} → " if was else ""}'
            f'{100 * zone.within_target:.1f} % within{bare}'
        )


def model_option(text: str) -> Callable:
    """The model that a command begins with."""
    return click.option('--model', 'model_file', type=FILE, help=text)


MODEL = model_option('Deposition model, YAML; default: a 50 mm bell.')
BRUSH = click.option(
    '--brush', default=0, type=click.IntRange(min=0), show_default='the only one',
    help='Number of the brush to work with, of a model with several.',
)  # fmt: skip


def seed_option(of: str) -> Callable:
    """The seed of what a command draws at random."""
    return click.option('--seed', default=0, show_default=True, help=f'Random seed of {of}.')


def _vector(ctx: click.Context, param: click.Parameter, given: tuple | None) -> np.ndarray | None:
    if given is None:
        return None
    import numpy as np

    if not any(given):
        raise click.BadParameter('0 0 0 has no direction; give a direction, as 0 0 -1', ctx, param)
    return np.array(given)


def _pose(ctx: click.Context, param: click.Parameter, given: tuple | None) -> list[float] | None:
    if given is None:
        return None
    from paint_deposition.motion.part_frame import is_pose

    if not is_pose(given):
        words = f'the quaternion qx qy qz qw has the norm {math.hypot(*given[3:]):.4g}, not 1'
        raise click.BadParameter(words, ctx, param)
    return list(given)


def _allow_effects(ctx: click.Context, param: click.Parameter, given: bool) -> None:
    if given:
        from paint_deposition.effects.catalogue import effects_allowed

        token = effects_allowed.set(True)
        ctx.call_on_close(lambda: effects_allowed.reset(token))


ALLOW_EFFECTS = click.option(
    '--allow-effects', is_flag=True, expose_value=False, callback=_allow_effects,
    help='Run the Python code of effect files that recordings, results or campaigns name, too.',
)  # fmt: skip
MAX_POSE_GAP = click.option(
    '--max-pose-gap-s', default=0.25, show_default=True, type=POSITIVE,
    help='A longer interval between poses is a gap, in which the gun is off.',
)  # fmt: skip


PART_POSE = click.option(
    '--part-pose', nargs=7, type=NUMBER, metavar='X Y Z QX QY QZ QW', callback=_pose,
    help='Where the part stands in the frame of the poses [m, unit quaternion].',
)  # fmt: skip
PAINT_MOVES = click.option(
    '--paint-moves', is_flag=True,
    help='Spray by PaintL with SetBrush in passes.mod; default: by MoveL, with an output.',
)  # fmt: skip
# How the motion is read and brought to the part: the fields of MotionSource.
MOTION = (
    click.option('--pose-topic',
                 help='Poses in the bag; default: its only PoseStamped topic. With --urdf: joint '
                 'states, several with blanks between them.'),
    click.option(
        '--state-topic', '--trigger', 'state_topic',
        help='Trigger of the gun: a topic of AtomizerState or Bool, a number in a field of any '
        'message, as /io.states[3] or "/io.level > 12", or the column of a table; default: it '
        'sprays whenever poses flow.',
    ),
    click.option(
        '--gun-signal',
        help='Digital output that opens the gun, for a RAPID module that sets several.',
    ),
    click.option('--procedure', help='Where a RAPID program starts; default: main.'),
    click.option(
        '--tf', nargs=2, metavar='TARGET SOURCE',
        callback=lambda ctx, param, given: None if given is None else list(given),
        help='Take the poses from the transforms of the bag: frame SOURCE, the TCP, in TARGET.',
    ),
    click.option(
        '--urdf', type=click.Path(),
        help='Take the poses from this robot and its joints in a bag or a table.',
    ),
    click.option('--tip', '--tip-link', 'tip_link',
                 help='Link of the URDF that is the TCP; default: tool0, else its last link.'),
    click.option('--base', '--base-link', 'base_link',
                 help='Link of the URDF for the frame of the poses; default: its root.'),
    click.option('--joint-prefix',
                 help="What the joints' names have before those of the URDF, or lack: irb_."),
    click.option('--pose-unit', type=click.Choice(['m', 'mm', 'cm']),
                 help='Unit of positions and rails; default: that of the headings, else m.'),
    click.option(
        '--rotation', metavar='CONVENTION',
        help='Three numbers of an orientation in a table: rotvec, or Euler angles as ZYX (axes of '
        'the tool), xyz (fixed axes), kuka, abb, fanuc, rpy, staubli, kawasaki.',
    ),
    click.option('--angle-unit', type=click.Choice(['deg', 'rad']),
                 help='Unit of joints and angles; default: that of the headings, else rad.'),
    click.option('--tool-axis', type=click.Choice(['x', 'y', 'z', '-x', '-y', '-z']),
                 help='Axis of the recorded tool along which it sprays, x for a KUKA; default: z'),
    click.option('--frame-id', help="Name of the part's frame; default: part."),
    click.option('--strict', is_flag=True,
                 help='Refuse a recording with a pose or state that would be left out.'),
    PART_POSE,
)  # fmt: skip


def option_group(
    options: Sequence[Callable], into: str, kind: Callable[..., Any] = dict
) -> Callable[[Callable], Callable]:
    """Give a command these options; it takes what was given as one argument, of a kind."""

    def with_options(function: Callable) -> Callable:
        return reduce(lambda taken, option: option(taken), reversed(options), function)

    def with_group(command: Callable) -> Callable:
        @wraps(command)
        def with_one(**given: Any) -> Any:
            return command(**{into: kind(**{n: given.pop(n) for n in names})}, **given)

        return with_options(with_one)

    names = [option.name for option in click.command('any')(with_options(lambda: None)).params]
    return with_group


motion_options = option_group(MOTION, 'motion')
JOINT_ACCELERATION = click.option(
    '--joint-acceleration', type=POSITIVE,
    help='Of every joint of a robot that is to drive the motion [rad/s2 or m/s2]; default: full '
    'speed in a quarter of a second.',
)  # fmt: skip
# The robot that is to drive a plan: what `read_robot` takes beside the pose of the part.
robot_options = option_group(
    (
        click.option(
            '--urdf', type=FILE,
            help='Robot that is to drive it; --part-pose says where the part stands in its base.',
        ),
        click.option('--tip', '--tip-link', 'tip_link',
                     help='Link of the URDF that is the TCP; default: tool0, else its last link.'),
        click.option('--base', '--base-link', 'base_link',
                     help='Link of the URDF for the frame of the poses; default: its root.'),
        JOINT_ACCELERATION,
    ),
    'robot',
)  # fmt: skip


def robot_cell(robot: dict[str, Any], part_pose: list[float] | None) -> Any:
    """The robot of ``robot_options`` with the part; None where none is given."""
    if robot['urdf'] is None:
        return None
    if part_pose is None:
        raise click.UsageError('--urdf needs --part-pose: where the part stands in its base')
    from paint_deposition.api.robot import read_robot

    return read_robot(part_pose=part_pose, **robot)


def part_options(max_edge_length_m: float, required: bool = True) -> Callable:
    """The part and how its mesh is read: a command takes ``read_mesh``'s arguments as ``part``."""
    options = (
        click.option('--mesh', 'path', required=required, type=FILE,
                     help='The part: STL, PLY, OBJ, glTF, 3MF or STEP.'),
        click.option(
            '--mesh-scale', 'scale', default=1.0, show_default=True, type=POSITIVE,
            help='Metres per unit of the mesh file; 0.001 for millimetres. glTF, 3MF and STEP '
            'name their unit: leave it out there.',
        ),
        click.option(
            '--body',
            help='The one body to take of a mesh file with several; default: all as one part.',
        ),
        click.option(
            '--max-edge-length-m', default=max_edge_length_m, show_default=True, type=POSITIVE,
            help='Longest edge of the refined mesh: larger triangles are split.',
        ),
        click.option(
            '--down', nargs=3, type=NUMBER, metavar='X Y Z', callback=_vector,
            help='Gravity in the mesh frame; default: -z, or -y if drawn flat at z = 0.',
        ),
    )  # fmt: skip
    return option_group(options, 'part')


def python(code: str, *words: str) -> list[str]:
    """The command of another Python that runs code and takes no module from this folder."""
    head = 'import sys; sys.path[:] = filter(None, sys.path); '
    return [sys.executable, '-c', head + code, *words]


def print_all(label: str, lines: Iterable[str]) -> None:
    """Print each line behind its label on stderr: notes, warnings."""
    for line in lines:
        click.echo(f'{label}: {line}', err=True)


def geometry_lines(result: pd.Comparison | pd.Diagnosis | pd.Calibration) -> Iterator[str]:
    """How the gun ran over each part of a campaign."""
    return (f'{name}: {found.sentence}' for name, found in result.geometry.items())


@dataclass
class Results:
    """Where a command writes its results, and how it shows them."""

    output: Path
    pictures: str
    as_json: bool
    files: Sequence[Path] = ()

    def write(self, result: Any, **more: Any) -> None:
        """Write a result to the folder, all or nothing."""
        with results_in(self.output) as folder:
            files = pd.write(result, folder, pictures=self.pictures, **more)
        self.files = [self.output / file.name for file in files]

    def print(self, lines: Iterable[str], model: str = '') -> None:
        """Print the file of figures as written, or else the model, these lines and the files."""
        head = [f'model: {model}'] if model else []
        if self.as_json:
            figures = next(file for file in self.files if file.suffix == '.json')
            click.echo(figures.read_text(encoding='utf-8'), nl=False)
        else:
            click.echo('\n'.join([*head, *lines, *(f'  {file}' for file in self.files)]))


def results_options(what: str, default: str | None = None) -> Callable[[Callable], Callable]:
    """A command takes ``Results``; their folder is to be named where there is no default."""
    text = (
        f'Folder for {what}. It is made if it is not there. Results that an earlier command wrote '
        'into it are removed; other files in it are kept as they are. Nothing is changed before '
        'all results are complete.'
    )
    options = (
        click.option('-o', '--output', type=FOLDER, required=default is None, default=default,
                     help=text),
        click.option('--pictures', type=click.Choice(['png', 'svg', 'pdf']), default='png',
                     show_default=True, help='Format of the pictures.'),
        JSON,
    )  # fmt: skip
    return option_group(options, 'results', Results)


def paint_lines(result: pd.Film | pd.Plan | pd.PartPlan) -> Iterator[str]:
    """Paint sprayed, transfer efficiency and wet film, where the model's brushes say enough."""
    from paint_deposition.film.paint_used import paint_sentence

    return (line for line in [paint_sentence(result)] if line)
