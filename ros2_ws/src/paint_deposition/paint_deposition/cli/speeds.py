"""What `inspect` shows of a recorded motion beside its programme."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import paint_deposition as pd
from paint_deposition.cli.options import say_all
from paint_deposition.cli.progress import Progress
from paint_deposition.files.json_files import json_text
from paint_deposition.files.provenance import origin


def show_speeds(
    path: Path,
    programmed: Path,
    motion: dict[str, Any],
    max_pose_gap_s: float,
    output: Path | None,
    as_json: bool,
) -> None:
    """Print driven against programmed speed, and draw it if a picture is wanted."""
    with Progress('inspect') as tell:
        tell('reading')
        recorded, programme = pd.read_recording(path, **motion), pd.read_recording(programmed)
        speed = pd.compare_speeds(recorded, programme, max_pose_gap_s=max_pose_gap_s)
        if output is not None:
            from paint_deposition.report.pictures.motion import write_speed_picture

            tell('drawing')
            write_speed_picture(output, speed, f'{path.name} against {programmed.name}')
    say_all('note', [*recorded.notes, *programme.notes])
    say_all('warning', recorded.warnings)
    if as_json:
        made_from = origin(files={'recording': path, 'programme': programmed})
        told = speed.to_dict() | {'picture': output, 'provenance': made_from}
        click.echo(json_text(told))
        return
    for one in speed.passes:
        click.echo(f'pass {one.number}: {one.sentence}')
    click.echo(f'all: {speed.whole.sentence}')
    click.echo(f'{100 * speed.on_programme:.0f} % of the way sprayed lies on the programme')
    if output is not None:
        click.echo(f'  {output}')
