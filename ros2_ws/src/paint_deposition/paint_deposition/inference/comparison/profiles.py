"""Film along the columns or rows of readings, measured and predicted: Figure 8 of the paper.

Conner, Atkar, Rizzi and Choset (IROS 2002), section 4.3: profiles by column, with the deposition
of each single pass.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.campaign import STENCIL_M, Experiment
from paint_deposition.inference.readings.places import FEWEST_ON_A_LINE, passes_are_level
from paint_deposition.part.points import STANDING_COSINE, across_axis, downhill_axis


@dataclass(frozen=True)
class Profile:
    """One column or row of readings."""

    # Name of the experiment and of the column or row.
    experiment: str
    label: str
    axis: str  # what the position is measured along, in words
    rows: np.ndarray  # (n,) points of the study, in order along the line
    position_m: np.ndarray  # (n,) of the points along the axis [m]
    # (L,) positions of the model's lines [m]; empty where there are too few readings.
    line_m: np.ndarray
    # (models, L) what a gauge would show there, and (passes, L) paint that each single pass
    # brought, last model [um]; NaN where the line leaves the part.
    lines_um: np.ndarray
    passes_um: np.ndarray


def profiles_of(study: Study, models: Sequence[DepositionModel]) -> list[Profile]:
    """Profiles of every group of readings; of strips of the part where readings have no group.

    A model's line runs through the readings of a group, and along the middle of a strip.

    Args:
        models: whose lines are wanted; single passes are those of the last.
    """
    found, first = [], 0
    for experiment in study.campaign.experiments:
        up, across = _axes(experiment)
        for label, members, upright, is_strip in _lines(experiment, up[2], across[2]):
            # In order upright or across.
            words, direction, along_m = up if upright else across
            members = members[np.argsort(along_m[members], kind='stable')]
            film = np.empty(0), np.empty((len(models), 0)), np.empty((0, 0))
            if len(members) >= FEWEST_ON_A_LINE:
                measured = experiment.measured_points.select(members)
                places = measured.positions_m
                if is_strip:
                    _, aside, away_m = across if upright else up
                    away_m = away_m[members] - np.median(away_m[members])
                    places = places - np.outer(away_m, aside)
                film = _film_along(
                    experiment, models, direction, along_m[members], places, measured.normals
                )
            found.append(
                Profile(experiment.name, label, words, first + members, along_m[members], *film)
            )
        first += len(experiment)
    return found


# A direction in which the readings of a line follow each other: in words, as a unit vector (3,),
# and the coordinate of each point of the experiment along it (P,) [m].
Axis = tuple[str, np.ndarray, np.ndarray]


def _axes(experiment: Experiment) -> tuple[Axis, Axis]:
    """Up the part and across it; a part that lies has no height, but a far end."""
    surface, positions_m = experiment.surface, experiment.measured_points.positions_m
    right = across_axis(surface.outward, surface.down)
    across_m = positions_m @ right - float(surface.centre_m @ right)
    words, up = 'height above the lowest point', -surface.down
    if abs(surface.outward @ surface.down) > STANDING_COSINE:
        words, up = (
            'along the part, from its near end',
            -downhill_axis(surface.outward, surface.down),
        )
    height_m = positions_m @ up - float((surface.vertices_m @ up).min())
    return (words, up, height_m), ('across, to the right from the gun', right, across_m)


def _lines(
    experiment: Experiment, height_m: np.ndarray, across_m: np.ndarray
) -> Iterator[tuple[str, np.ndarray, bool, bool]]:
    """Label and members of each group or, without any, of strips that cross the passes.

    With each: whether it is longer upright than across, and whether it is a strip.
    """
    # 'column 2' before 'column 10': text and numbers in turn.
    parts = {str(g): re.split(r'(\d+)', str(g)) for g in experiment.groups if g}
    labels = sorted(parts, key=lambda g: [int(p) if p.isdecimal() else p for p in parts[g]])
    for label in labels:
        members = np.flatnonzero(experiment.groups == label)
        yield label, members, np.ptp(height_m[members]) >= np.ptp(across_m[members]), False
    if labels:
        return
    upright = passes_are_level(experiment.path, experiment.surface.down)
    aside, what = (across_m, 'across') if upright else (height_m, 'height')
    # About twenty readings to a strip, in six strips at the most.
    count = int(np.clip(round(len(aside) / 20), 1, 6))
    for part in np.array_split(np.argsort(aside, kind='stable'), count):
        ends = 1e3 * aside[part].min(), 1e3 * aside[part].max()
        label = f'{what} {ends[0]:.0f} to {ends[1]:.0f} mm' if count > 1 else 'all readings'
        yield label, part, upright, True


def _film_along(
    experiment: Experiment, models: Sequence[DepositionModel], direction: np.ndarray,
    position_m: np.ndarray, places: np.ndarray, normals: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Positions, films of the models and of each pass alone, through places and normals (n, 3)."""
    low, high = position_m[[0, -1]]
    beyond = (high - low) / (len(position_m) - 1)
    # Model lines are drawn through points this close along the surface [m].
    steps = max(2, int(np.ceil((high - low + 2.0 * beyond) / 0.01)) + 1)
    at = np.unique(np.concatenate([np.linspace(low - beyond, high + beyond, steps), position_m]))
    line = np.column_stack([
        np.interp(at, position_m, column) for column in np.hstack([places, normals]).T
    ])  # fmt: skip
    for end, outside in ((0, at < low), (-1, at > high)):
        way = direction - (direction @ normals[end]) * normals[end]
        way /= way @ direction
        line[outside, :3] += np.outer(at[outside] - position_m[end], way)
    # Beyond the first and last reading lines go on for as far as readings are apart, but not off
    # the surface by more than 3 mm. Between readings they break where they are 20 mm off it, at a
    # cut-out say, or where the nearest surface faces another way, a hem say.
    _, outward, off_m = experiment.surface.locate(line[:, :3], line[:, 3:])
    between = (low <= at) & (at <= high)
    facing = np.einsum('ij,ij->i', outward, line[:, 3:]) > 0.5
    on = facing & (off_m < np.where(between, 0.02, 0.003))
    at, line, on = at[between | on], line[on], on[between | on]
    slopes = any(effect.needs_slope for model in models for effect in model.effects)
    points = experiment.surface.at(line[:, :3], line[:, 3:], STENCIL_M if slopes else None)

    path, count, films = experiment.path, int(on.sum()), []
    for model in models:
        integrator = FilmIntegrator(points, model, 'double', experiment.surface)
        integrator.add(path)
        films.append(integrator.gauge_um[:count])
    # Of a pass alone the others are kept, with the gun off.
    passes = [
        integrator.raw_of(path.with_flow_scaled(path.spray_pass == number))[:count]
        for number in np.unique(path.spray_pass[path.spray_pass >= 0])
    ]
    lines = np.full((len(films) + len(passes), len(at)), np.nan)
    lines[:, on] = [*films, *passes]
    return at, lines[: len(films)], lines[len(films) :]
