"""The command `demo`: from a recording to a better door, on the samples."""

from __future__ import annotations

import os
import shlex
import sys
import time
import webbrowser
from pathlib import Path
from typing import Any

import click

import paint_deposition as pd
from paint_deposition.cli.options import FOLDER
from paint_deposition.cli.results import results_in

PAGE = 'demo.html'
STATE = '/atomizer/state'
# By the simulator that made the samples: the head of their campaign.yaml says how.
HIDDEN = 'incidence_attraction'


@click.command('demo')
@click.option(
    '-o', '--output', type=FOLDER, default=Path('paint_demo'), show_default=True,
    help=f'Folder for {PAGE} and the results that it tells of.',
)  # fmt: skip
@click.option(
    '--open/--no-open', 'opens', default=True, show_default=True,
    help='Open the page in the browser, where there is a display.',
)  # fmt: skip
def demo_command(output: Path, opens: bool) -> None:
    """Paint a sample door, find what the model lacks by its readings, plan a better door.

    The page that opens at the end tells it with pictures.
    """
    samples = pd.sample_folder() / 'measured_door'
    mesh, recording, unseen = (samples / name for name in ('door.stl', 'door', 'unseen.yaml'))
    campaign = samples / 'campaign.yaml'
    motion = ('--mesh', mesh, '--trajectory', recording, '--state-topic', STATE)
    models = [output / 'diagnosis' / f'{name}.yaml' for name in ('model_before', 'model')]
    told = _Told(output)

    told.begin('Painting a door', 'film', 'simulate', *motion)
    from paint_deposition.files.model_file import read_model_file
    from paint_deposition.report import page
    from paint_deposition.report.data import ReportData

    told.step('reading mesh and recording; the first run also compiles')
    trajectory = pd.read_recording(recording, state_topic=STATE)
    film = pd.simulate(pd.read_mesh(mesh, max_edge_length_m=0.01), trajectory, progress=told.step)
    told.end(film, page.film_figures(film))

    told.begin('Diagnosing its readings', 'diagnosis', 'diagnose', campaign)
    found = pd.diagnose(pd.read_campaign(campaign), progress=told.step)
    told.end(found, page.key_figures(ReportData.of(found)))

    given = [word for model in models for word in ('--model', model)]
    told.begin('Comparing with readings that no fit has seen', 'unseen', 'compare', unseen, *given)
    beside = pd.compare_models(
        pd.read_campaign(unseen), {path.stem: pd.read_model(path) for path in models},
        progress=told.step,
    )  # fmt: skip
    told.end(beside, page.unseen_figures(beside))

    told.begin('Planning the next door', 'improved', 'improve', *motion, '--model', models[1])
    better = read_model_file(models[1])
    improved = pd.improve(
        pd.read_mesh(mesh, max_edge_length_m=0.02), trajectory, better.model,
        posterior=better.posterior, progress=told.step,
    )  # fmt: skip
    told.end(improved, page.improvement_figures(improved))

    path = page.write_story(output / PAGE, film, found, beside, improved, HIDDEN, told.commands)
    click.echo(f'\nThe story with pictures: {path}')
    # Where a browser has somewhere to show a page.
    desktop = sys.platform in ('darwin', 'win32')
    if opens and (desktop or any(os.environ.get(n) for n in ('DISPLAY', 'WAYLAND_DISPLAY'))):
        webbrowser.open(path.resolve().as_uri())


class _Told:
    """What is being done, on the terminal, piped or not.

    Attributes:
        commands: that do the same by hand, by their names.
    """

    def __init__(self, output: Path) -> None:
        self.commands: dict[str, str] = {}
        self._output, self._folder, self._step = output, output, ''
        self._began_s = time.monotonic()

    def begin(self, what: str, folder: str, *command: object) -> None:
        """Say what comes next, and the command that writes the same to its folder."""
        self._folder = self._output / folder
        words = shlex.join(map(str, [*command, '-o', self._folder]))
        self.commands[str(command[0])] = f'paint {words}'
        click.echo(f'\n{what}\n  $ paint {words}')

    def step(self, what: str, share: float | None = None) -> None:
        """Say what is being done, once."""
        if what != self._step:
            self._step = what
            click.echo(f'  {time.monotonic() - self._began_s:3.0f} s  {what}')

    def end(self, result: Any, figures: list[tuple[str, str, str, str]]) -> None:
        """Write a result, and say its figures."""
        self.step('writing and drawing')
        with results_in(self._folder) as folder:
            pd.write(result, folder)
        for label, before, after, unit in figures:
            click.echo(f'  {label + ":":32} {before + " -> " if before else ""}{after} {unit}')
