"""Film along the columns or rows of readings, measured and predicted: Figure 8 of the paper.

Conner, Atkar, Rizzi and Choset (IROS 2002), section 4.3: profiles by column, with the deposition
of each single pass.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.inference.fitting.study import Study
from paint_deposition.inference.readings.campaign import STENCIL_M, Experiment
from paint_deposition.inference.readings.placement import FEWEST_ON_A_LINE, passes_are_level
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.orientation import across_axis

# Model lines are drawn through points this close along the surface [m].
LINE_STEP_M = 0.01
# Readings without rows or columns are shown in strips of the part, about this many to a strip.
READINGS_A_STRIP = 20
MOST_STRIPS = 6


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
    lines_um: np.ndarray  # (models, L) what a gauge would show there [um]
    passes_um: np.ndarray  # (passes, L) paint that each single pass brought, last model [um]


def profiles_of(study: Study, models: Sequence[DepositionModel]) -> list[Profile]:
    """Profiles of every group of readings; of strips of the part where readings have no group.

    A model's line runs through the readings of a group, and along the middle of a strip.

    Args:
        models: whose lines are wanted; single passes are those of the last.
    """
    found, first = [], 0
    for experiment in study.campaign.experiments:
        for line in list(_grouped(experiment)) or list(_strips(experiment)):
            profile = _profile(experiment, models, *line)
            found.append(replace(profile, rows=first + profile.rows))
        first += len(experiment)
    return found


def _axes(experiment: Experiment) -> tuple[np.ndarray, np.ndarray]:
    """(P,) height over the part's lowest point and distance to the right of its centre [m]."""
    surface, positions = experiment.surface, experiment.measured_points.positions_m
    height = -positions @ surface.down - (-surface.vertices_m @ surface.down).min()
    return height, (positions - surface.centre_m) @ across_axis(surface.outward, surface.down)


def _grouped(experiment: Experiment) -> Iterator[tuple[str, np.ndarray, bool, bool]]:
    """Label and members of each group, and whether it is longer upright than across."""
    height_m, across_m = _axes(experiment)
    for label in sorted({str(g) for g in experiment.groups if g}, key=_natural):
        members = np.flatnonzero(experiment.groups == label)
        yield label, members, np.ptp(height_m[members]) >= np.ptp(across_m[members]), False


def _natural(label: str) -> tuple:
    """Sorts 'column 2' before 'column 10'."""
    digits = ''.join(c if c.isdigit() else ' ' for c in label).split()
    return (label.rstrip('0123456789'), int(digits[-1]) if digits else 0, label)


def _strips(experiment: Experiment) -> Iterator[tuple[str, np.ndarray, bool, bool]]:
    """Strips that cross the passes, each with about as many readings."""
    upright = passes_are_level(experiment.path, experiment.surface.down)
    height_m, across_m = _axes(experiment)
    aside, what = (across_m, 'across') if upright else (height_m, 'height')
    count = int(np.clip(round(len(aside) / READINGS_A_STRIP), 1, MOST_STRIPS))
    for part in np.array_split(np.argsort(aside, kind='stable'), count):
        ends = 1e3 * aside[part].min(), 1e3 * aside[part].max()
        label = f'{what} {ends[0]:.0f} to {ends[1]:.0f} mm' if count > 1 else 'all readings'
        yield label, part, upright, True


def _profile(
    experiment: Experiment, models: Sequence[DepositionModel], label: str, members: np.ndarray,
    upright: bool, is_strip: bool,
) -> Profile:  # fmt: skip
    """Of some of an experiment's points, in order upright or across."""
    surface, along = experiment.surface, _axes(experiment)[0 if upright else 1][members]
    order = np.argsort(along, kind='stable')
    members, position = members[order], along[order]
    axis = 'height above the lowest point' if upright else 'across, to the right from the gun'
    film = np.empty(0), np.empty((len(models), 0)), np.empty((0, 0))
    if len(members) >= FEWEST_ON_A_LINE:
        measured = experiment.measured_points.select(members)
        places = measured.positions_m
        if is_strip:
            aside = across_axis(surface.outward, surface.down) if upright else -surface.down
            away = places @ aside
            places = places - np.outer(away - np.median(away), aside)
        film = _film_along(experiment, models, position, np.hstack([places, measured.normals]))
    return Profile(experiment.name, label, axis, members, position, *film)


def _film_along(
    experiment: Experiment, models: Sequence[DepositionModel], position_m: np.ndarray,
    places: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Positions, films of the models and of each pass alone, through places and normals (n, 6)."""
    low, high = position_m[[0, -1]]
    steps = max(2, int(np.ceil((high - low) / LINE_STEP_M)) + 1)
    at = np.unique(np.concatenate([np.linspace(low, high, steps), position_m]))
    line = np.column_stack([np.interp(at, position_m, column) for column in places.T])
    slopes = any(effect.needs_slope for model in models for effect in model.effects)
    points = experiment.surface.at(line[:, :3], line[:, 3:], STENCIL_M if slopes else None)

    def integrated(model: DepositionModel, path: SprayPath) -> FilmIntegrator:
        integrator = FilmIntegrator(points, model, 'double', experiment.surface.occluder)
        integrator.add(path)
        return integrator

    path = experiment.path
    films = [integrated(model, path).gauge_um[: len(at)] for model in models]
    # Of a pass alone the others are kept, with the gun off.
    passes = [
        integrated(models[-1], path.with_flow_scaled(path.spray_pass == number)).raw_um[: len(at)]
        for number in np.unique(path.spray_pass[path.spray_pass >= 0])
    ]
    return at, np.array(films), np.array(passes)
