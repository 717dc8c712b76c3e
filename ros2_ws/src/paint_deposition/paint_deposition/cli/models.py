"""Which model a command works with, with the line that says so, and which robot drives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import paint_deposition as pd
from paint_deposition.cli.results import print_all
from paint_deposition.errors import ModelError

if TYPE_CHECKING:
    from paint_deposition.files.model_file import ModelFile
    from paint_deposition.planning.driving import RobotCell


def chosen_model(given: Path | None, brush: int = 0, named: bool = True) -> tuple[ModelFile, str]:
    """The model of a file, else the default, and the line for the user.

    ``brush`` is that of --brush, 0 for none.

    A file that is not ``named`` by the user, but by a recording, runs no effect files unasked.
    """
    from paint_deposition.files.effect_file import load_effect_file, load_unnamed_effect_file
    from paint_deposition.files.model_file import ModelFile, read_model_file

    file, words = ModelFile(pd.DepositionModel()), 'default, a 50 mm bell; --model gives another'
    if given is not None:
        file = read_model_file(given, load_effect_file if named else load_unnamed_effect_file)
        words = model_words(file) + (f', brush {brush}' if brush else '')
    if brush:
        file = replace(file, model=file.model.with_brush(brush))
    return file, words


def model_for(given: Path | None, motion: Path, named: bool = True) -> tuple[ModelFile, str]:
    """The model of a file, else the one that the motion was planned with, else a bell.

    ``named`` is as for ``chosen_model``. Warnings go to stderr.
    """
    from paint_deposition.files.effect_file import load_unnamed_effect_file
    from paint_deposition.files.model_file import read_model_file
    from paint_deposition.files.provenance import model_digest, planned_model

    planned = planned_model(motion)
    chosen = chosen_model(given, named=named)
    if planned is None:
        return chosen
    path, digest = planned
    if given is not None:
        model = chosen[0].model
        alike = [model, *(model.with_brush(brush.number) for brush in model.brushes)]
        if digest not in map(model_digest, alike):
            print_all('note', [f'{motion} was planned with another model ({digest[:12]})'])
        return chosen
    file = read_model_file(path, load_unnamed_effect_file) if path.is_file() else None
    if file is None or model_digest(file.model) != digest:
        print_all('warning', [
            f'{motion} was planned with a model ({digest[:12]}) that is not in '
            f'{path}; give it with --model, or the film is another one than planned'
        ])  # fmt: skip
        return chosen
    return file, f'that of the plan, {model_words(file)}'


def models_for(
    given: Sequence[Path], motions: Sequence[Path], guns: Sequence[str], named: bool = True
) -> list[tuple[ModelFile, str]]:
    """The model of each gun: one of those named with --model, else as ``model_for`` has it.

    Models and motions are given once for all guns or once for each.

    Raises:
        ModelError: there are models for some guns only.
    """
    if len(given) not in (0, 1, len(guns)):
        raise ModelError(
            f'--model is given {len(given)} times for {len(guns)} guns: give it once for all, or '
            'once for each'
        )
    files = [*given] if len(given) == len(guns) else [*given, None][:1] * len(guns)
    each = motions if len(motions) == len(guns) else [motions[0]] * len(guns)
    chosen = [model_for(*pair, named) for pair in zip(files, each, strict=True)]
    names = [f'{gun}: ' if len(given) > 1 else '' for gun in guns]
    return [(file, name + words) for name, (file, words) in zip(names, chosen, strict=True)]


def model_words(file: ModelFile) -> str:
    """'runs/model.yaml (1a2b3c4d5e6f), brushes: 1, 2, effects: air_drift'."""
    from paint_deposition.files.provenance import model_digest

    called = f" '{file.name}'" if file.name else ''
    effects = ', '.join(effect.id for effect in file.model.effects) or 'none'
    digest = model_digest(file.model)[:12]
    brushes = ', '.join(str(brush.number) for brush in file.model.brushes)
    of_brushes = f', brushes: {brushes}' if brushes else ''
    return f'{file.path}{called} ({digest}){of_brushes}, effects: {effects}'


def robot_cell(robot: dict[str, Any], part_pose: list[float] | None) -> RobotCell | None:
    """The robot of ``options.robot_options`` with the part; None where none is given."""
    if robot['urdf'] is None:
        names = {'tip_link': '--tip', 'base_link': '--base'}
        for name, value in robot.items():
            if value is not None:
                option = names.get(name, f'--{name.replace("_", "-")}')
                raise click.UsageError(f'{option} goes with a robot; give --urdf')
        return None
    if part_pose is None:
        raise click.UsageError('--urdf needs --part-pose: where the part stands in its base')
    from paint_deposition.api.planning import read_robot

    return read_robot(part_pose=part_pose, **robot)
