"""Options of a command from the model of its request."""

import inspect
import math
from typing import Literal

import click
import pytest
from click.testing import CliRunner

from paint_deposition.cli.main import paint
from paint_deposition.cli.options import options_of
from paint_deposition.request import FilmBand, MotionOptions, OnePart, Request, given, takes


class Coat(Request):
    speed_m_per_s: float = given(0.3, 'Of the passes [m/s].', '--speed', above=0.0, most=3.0)
    passes: int | None = given(None, 'How many.', least=1)
    lean_rad: float = given(0.0, 'Of the gun.', least=-math.pi / 4, most=math.pi / 4)
    outward: tuple[float, float, float] | None = given(None, 'To the gun.', metavar='X Y Z')
    direction: Literal['level', 'upright'] = given('level', 'Of the passes.')
    one_way: bool = given(False, 'All passes in one direction.')


@click.command()
@options_of(Coat, into='coat')
def command(coat):
    click.echo(repr(coat))


def run(*words):
    return CliRunner().invoke(command, [str(word) for word in words])


def test_each_field_is_an_option_and_the_command_gets_the_request():
    words = ('--speed', 0.5, '--passes', 3, '--lean-deg', 30, '--outward', 0, -1, 0)
    done = run(*words, '--direction', 'upright', '--one-way')
    expected = Coat(
        speed_m_per_s=0.5, passes=3, lean_rad=math.radians(30), outward=(0, -1, 0),
        direction='upright', one_way=True,
    )  # fmt: skip
    assert done.output.strip() == repr(expected)
    assert run().output.strip() == repr(Coat())


def test_help_shows_text_default_and_bounds():
    text = ' '.join(run('--help').output.split())
    assert '--speed FLOAT RANGE Of the passes [m/s]. [default: 0.3; 0.0<x<=3.0]' in text
    assert '--outward X Y Z' in text
    assert '--direction [level|upright]' in text


def test_a_verb_shows_the_fields_of_its_request():
    @takes(Coat)
    def spray(model, *, frame_id='part', **wanted):
        return Coat(**wanted)

    shown = inspect.signature(spray).parameters
    assert list(shown)[:3] == ['model', 'frame_id', 'speed_m_per_s']
    assert shown['speed_m_per_s'].default == 0.3


@pytest.mark.parametrize('kind', [MotionOptions, OnePart, FilmBand])
def test_options_are_the_keys_of_files_in_the_same_words(kind):
    command = paint.get_command(click.Context(paint), 'simulate')
    helps = {option.name: option.help for option in command.params if option.name}
    for name, field in kind.model_fields.items():
        assert helps[name] == field.description, name
