"""The command `demo`: from a recording to a better door, on the samples."""

from __future__ import annotations

import os
import shlex
import sys
import time
import webbrowser
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import click

import paint_deposition as pd
from paint_deposition.cli import options
from paint_deposition.cli.results_folder import results_in

if TYPE_CHECKING:
    from paint_deposition.report.page.report import Chapter

PAGE = 'demo.html'
STATE = '/atomizer/state'
# By the simulator that made the samples: the head of their campaign.yaml says how.
HIDDEN = 'incidence_attraction'
LINE = 88


@click.command('demo')
@click.option(
    '-o', '--output', type=options.FOLDER, default=Path('paint_demo'), show_default=True,
    help=f'Folder for {PAGE} and the results that it tells of.',
)  # fmt: skip
@click.option(
    '--open/--no-open', 'opens', default=True, show_default=True,
    help='Open the page in the browser, where there is a display.',
)  # fmt: skip
def demo_command(output: Path, opens: bool) -> None:
    """Paint a sample door, find what the model lacks by its readings, plan a better door.

    The page opens with the film and grows with every step.
    """
    samples = pd.sample_folder() / 'measured_door'
    mesh, recording, unseen = (samples / name for name in ('door.stl', 'door', 'unseen.yaml'))
    motion = ('--mesh', mesh, '--trajectory', recording, '--state-topic', STATE)
    models = [output / 'diagnosis' / f'{name}.yaml' for name in ('model_before', 'model')]
    story = _Story(output / PAGE, opens)
    try:
        story.begin('Painting a door', 'simulate', *motion, '-o', output / 'film')
        from paint_deposition.files.model_file import read_model_file
        from paint_deposition.report.page import report as chapters

        story.step('reading mesh and recording; the first run also compiles')
        trajectory = pd.read_recording(recording, state_topic=STATE)
        film = pd.simulate(
            pd.read_mesh(mesh, max_edge_length_m=0.01), trajectory, progress=story.step
        )
        story.tell(film, chapters.of_film(film))

        campaign = samples / 'campaign.yaml'
        story.begin('Diagnosing its readings', 'diagnose', campaign, '-o', output / 'diagnosis')
        found = pd.diagnose(pd.read_campaign(campaign), progress=story.step)
        story.tell(found, chapters.of_readings(found, 'door'))

        given = [word for model in models for word in ('--model', model)]
        story.begin('Comparing with readings that no fit has seen', 'compare', unseen, *given,
                    '-o', output / 'unseen')  # fmt: skip
        beside = pd.compare_models(
            pd.read_campaign(unseen), {path.stem: pd.read_model(path) for path in models},
            progress=story.step,
        )  # fmt: skip
        story.tell(beside, chapters.of_cause(found, beside, HIDDEN))

        story.begin('Planning the next door', 'improve', *motion, '--model', models[1], '-o',
                    output / 'improved')  # fmt: skip
        better = read_model_file(models[1])
        improved = pd.improve(
            pd.read_mesh(mesh, max_edge_length_m=0.02), trajectory, better.model,
            posterior=better.posterior, progress=story.step,
        )  # fmt: skip
        story.tell(improved, chapters.of_improvement(improved))
    finally:
        story.end()
    click.echo(f'\nThe story with pictures: {story.page}')


class _Story:
    """The page as it grows, and the same words on the terminal, piped or not."""

    def __init__(self, page: Path, opens: bool) -> None:
        self.page = page
        # Where a browser has somewhere to show a page.
        desktop = sys.platform in ('darwin', 'win32')
        desktop |= any(os.environ.get(name) for name in ('DISPLAY', 'WAYLAND_DISPLAY'))
        self._opens = opens and desktop
        self._told: list[tuple[Chapter, str]] = []
        self._command, self._folder, self._step = '', page.parent, ''
        self._underway = ''
        self._began_s = time.monotonic()

    def begin(self, what: str, *command: object) -> None:
        """Say what comes next and the command, with its folder at the end, that does the same."""
        self._command = f'paint {shlex.join(map(str, command))}'
        self._folder = Path(str(command[-1]))
        self._underway = what
        click.echo(f'\n{what}\n  $ {self._command}')
        self._write()

    def step(self, what: str, share: float | None = None) -> None:
        """Say what is being done, once."""
        if what != self._step:
            self._step = what
            click.echo(f'  {time.monotonic() - self._began_s:3.0f} s  {what}')

    def tell(self, result: Any, chapter: Chapter) -> None:
        """Write a result and its chapter."""
        self.step('writing and drawing')
        with results_in(self._folder) as folder:
            pd.write(result, folder)
        self._told.append((chapter, self._command))
        self._underway = ''
        for paragraph in chapter.text:
            click.echo(fill(paragraph, LINE, initial_indent='  ', subsequent_indent='  '))
        for label, before, after, unit in chapter.figures:
            click.echo(f'  {label + ":":32} {before + " -> " if before else ""}{after} {unit}')

    def _write(self, ended: bool = False) -> None:
        if self._told:
            from paint_deposition.report.page.report import write_story

            write_story(self.page, self._told, self._underway, ended)
            if self._opens:
                self._opens = not webbrowser.open(self.page.resolve().as_uri())

    def end(self) -> None:
        """Write the page for the last time: it says where it was cut off, and waits no more."""
        self._write(ended=True)
