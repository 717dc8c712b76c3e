"""What several commands take and say alike: numbers, options, inputs and results."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from paint_deposition.effects.deposition_model import DepositionModel
    from paint_deposition.files.model_file import ModelFile
    from paint_deposition.readings.campaign import Campaign


class Finite:
    """Of a type of numbers those that are finite: `nan` and `inf` are numbers to Python."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = super().convert(value, param, ctx)  # type: ignore[misc]
        if not math.isfinite(number):
            raise click.BadParameter(f'{value} is not finite; give a number', ctx, param)
        return number


class FiniteNumber(Finite, click.types.FloatParamType):
    """Any finite number."""


class FiniteRange(Finite, click.FloatRange):
    """A finite number within bounds."""


NUMBER = FiniteNumber()
POSITIVE = FiniteRange(min=0.0, min_open=True)
NOT_NEGATIVE = FiniteRange(min=0.0)
FILE = click.Path(path_type=Path)
FOLDER = click.Path(path_type=Path, file_okay=False)
JSON = click.option('--json', 'as_json', is_flag=True, help='Print the figures as JSON.')
CAMPAIGN = click.argument('campaign', type=FILE)


def model_option(text: str) -> Callable:
    """The model that a command begins with."""
    return click.option('--model', 'model_file', type=FILE, help=text)


def output_option(what: str, **more: Any) -> Callable:
    """The folder for a command's results."""
    text = (
        f'Folder for {what}. It is made if it is not there. Results that an earlier command wrote '
        'into it are removed; other files in it are kept, unless a result has their name. Nothing '
        'is changed before all results are complete.'
    )
    return click.option('-o', '--output', type=FOLDER, help=text, **more)


def seed_option(of: str) -> Callable:
    """The seed of what a command draws at random."""
    return click.option('--seed', default=0, show_default=True, help=f'Random seed of {of}.')


def direction_option(name: str, text: str) -> Callable:
    """A direction in space, three finite numbers that are not all zero, or None."""
    return click.option(name, nargs=3, type=NUMBER, metavar='X Y Z', callback=_not_zero, help=text)


def _not_zero(
    ctx: click.Context, param: click.Parameter, vector: tuple[float, float, float] | None
) -> tuple[float, float, float] | None:
    if vector is not None and not any(vector):
        raise click.BadParameter('0 0 0 is none; give a direction, 0 0 -1 say', ctx, param)
    return vector


GUN_SIGNAL = click.option(
    '--gun-signal', help='Digital output that opens the gun, for a RAPID module that sets several.'
)


def mesh_scale_option() -> Callable:
    """Metres per unit of the mesh file."""
    return click.option(
        '--mesh-scale', default=1.0, show_default=True, type=POSITIVE,
        help='Metres per unit of the mesh file; 0.001 for millimetres.',
    )  # fmt: skip


def max_edge_length_option(default_m: float) -> Callable:
    """How fine the mesh is refined."""
    return click.option(
        '--max-edge-length-m', default=default_m, show_default=True, type=POSITIVE,
        help='Triangles are split until no edge is longer.',
    )  # fmt: skip


def max_pose_gap_option() -> Callable:
    """What counts as a gap between poses."""
    return click.option(
        '--max-pose-gap-s', default=0.25, show_default=True, type=POSITIVE,
        help='A longer time between poses is a gap: gun off.',
    )  # fmt: skip


def read_noted(path: Path, tell: Callable[[str], None]) -> Campaign:
    """Read a campaign; `tell` gets each line of progress, stderr each note on an experiment."""
    from paint_deposition.files.campaign_file import read_campaign

    def show(line: str) -> None:
        if line.startswith('reading '):
            tell(line)
        else:
            click.echo(f'note: {line}', err=True)

    return read_campaign(path, show)


def read_start(campaign: Campaign, model_file: Path | None) -> ModelFile | None:
    """The model named with --model, else the campaign's, if it names one."""
    from paint_deposition.files.model_file import read_model_file

    chosen = model_file or campaign.model_file
    return read_model_file(chosen) if chosen else None


def read_given_model(model_file: Path | None) -> DepositionModel:
    """The model named with --model, else that of a 50 mm bell."""
    from paint_deposition.effects.deposition_model import DepositionModel
    from paint_deposition.files.model_file import read_model

    return read_model(model_file) if model_file else DepositionModel()


def say_all(label: str, lines: Iterable[str], err: bool = False) -> None:
    """Print each line behind its label: notes, warnings."""
    for line in lines:
        click.echo(f'{label}: {line}', err=err)


def say_files(files: Iterable[Path], output: Path) -> None:
    """Print the files of a folder of results by their final names."""
    for file in files:
        click.echo(f'  {output / file.name}')
