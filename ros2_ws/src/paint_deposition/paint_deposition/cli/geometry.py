"""What `inspect` shows of a motion beside a part."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import paint_deposition as pd
from paint_deposition.cli.model_choice import model_for
from paint_deposition.cli.options import say_all
from paint_deposition.cli.progress import Progress
from paint_deposition.files.json_files import json_text
from paint_deposition.files.provenance import origin

if TYPE_CHECKING:
    import numpy as np

# A picture shows no finer mesh than this.
MAX_EDGE_LENGTH_M = 0.02


def show_gun_on_part(
    mesh: Path,
    path: Path,
    motion: dict[str, Any],
    max_pose_gap_s: float,
    as_json: bool,
    *,
    output: Path | None,
    model_file: Path | None,
    mesh_scale: float,
    body: str | None,
    down: np.ndarray | None,
) -> None:
    """Print how the gun ran over a part and what is odd, and draw it if a picture is wanted."""
    with Progress('inspect') as tell:
        tell('reading')
        recorded = pd.read_recording(path, **motion)
        surface = pd.read_mesh(mesh, mesh_scale, MAX_EDGE_LENGTH_M, down, body)
        model = model_for(model_file, path).model
        seen = pd.look_at(surface, recorded, model, max_pose_gap_s=max_pose_gap_s)
        if output is not None:
            from paint_deposition.report.pictures.geometry import write_geometry_picture

            tell('drawing')
            write_geometry_picture(
                output, seen.surface, seen.path, seen.geometry, f'{path.name} over {mesh.name}'
            )
    say_all('note', seen.notes)
    say_all('warning', [*recorded.warnings, *seen.geometry.warnings])
    if as_json:
        files = {'mesh_file': str(mesh), 'trajectory': str(path), 'picture': output}
        made_from = origin(model, {'mesh': mesh, 'trajectory': path})
        click.echo(json_text(seen.to_dict() | files | {'provenance': made_from}))
        return
    click.echo(seen.geometry.sentence)
    click.echo(seen.geometry.facet_sentence)
    if output is not None:
        click.echo(f'  {output}')
