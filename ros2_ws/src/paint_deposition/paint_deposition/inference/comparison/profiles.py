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
from paint_deposition.inference.readings.rows_and_columns import FEWEST_ON_A_LINE, passes_are_level
from paint_deposition.motion.path import SprayPath
from paint_deposition.part.axes import across_axis
from paint_deposition.part.points import SurfacePoints

# Model lines are drawn through points this close along the surface [m].
LINE_STEP_M = 0.01
# Readings without rows or columns are shown in strips of the part, about this many to a strip.
READINGS_A_STRIP = 20
MOST_STRIPS = 6


@dataclass(frozen=True)
class Profile:
    """One column or row of readings.

    Attributes:
        experiment, label: name of the experiment and of the column or row.
        axis: what the position is measured along, in words.
        rows: (n,) points of the study, in order along the line.
        position_m: (n,) of the points along the axis [m].
        line_m: (L,) positions of the model's lines [m]; empty where there are too few readings.
        lines_um: (models, L) what a gauge would show there [um].
        passes_um: (passes, L) paint that each single pass brought, last model [um].
    """

    experiment: str
    label: str
    axis: str
    rows: np.ndarray
    position_m: np.ndarray
    line_m: np.ndarray
    lines_um: np.ndarray
    passes_um: np.ndarray


def profiles_of(study: Study, models: Sequence[DepositionModel]) -> list[Profile]:
    """Profiles of every group of readings; of strips of the part where readings have no group.

    A model's line runs through the readings of a group, and along the middle of a strip.

    Args:
        study: the readings.
        models: whose lines are wanted; single passes are those of the last.
    """
    found = []
    for index, experiment in enumerate(study.campaign.experiments):
        rows = np.flatnonzero(study.campaign.experiment_of == index)
        lines = [_Line.of(experiment, label, members) for label, members in _grouped(experiment)]
        lines = lines or list(_strips(experiment))
        drawn = [line for line in lines if len(line.members) >= FEWEST_ON_A_LINE]
        films = _films_along(experiment, drawn, models)
        for line in lines:
            at, lines_um, passes_um = films.get(line.label, _nothing(len(models)))
            found.append(
                Profile(experiment.name, line.label, line.axis, rows[line.members],
                        line.position_m, at, lines_um, passes_um)
            )  # fmt: skip
    return found


@dataclass(frozen=True)
class _Line:
    label: str
    axis: str
    members: np.ndarray
    position_m: np.ndarray
    places_m: np.ndarray

    @staticmethod
    def of(
        experiment: Experiment, label: str, members: np.ndarray, upright: bool | None = None
    ) -> '_Line':
        height_m, across_m = _axes(experiment, members)
        if upright is None:
            upright = np.ptp(height_m) >= np.ptp(across_m)
        position = height_m if upright else across_m
        axis = 'height above the lowest point' if upright else 'across, to the right from the gun'
        order = np.argsort(position, kind='stable')
        places = experiment.points.positions_m[members[order]]
        return _Line(label, axis, members[order], position[order], places)

    @staticmethod
    def along_strip(
        experiment: Experiment, label: str, members: np.ndarray, upright: bool
    ) -> '_Line':
        """A line whose places lie along the middle of the strip."""
        line = _Line.of(experiment, label, members, upright)
        surface = experiment.surface
        across = across_axis(surface.outward, surface.down)
        aside = across if upright else -surface.down
        away = line.places_m @ aside
        return replace(line, places_m=line.places_m - np.outer(away - np.median(away), aside))


def _axes(experiment: Experiment, members: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Height over the part's lowest point and distance to the right of its centre [m]."""
    surface = experiment.surface
    positions = experiment.points.positions_m[members]
    height = -positions @ surface.down - (-surface.vertices_m @ surface.down).min()
    return height, (positions - surface.centre_m) @ across_axis(surface.outward, surface.down)


def _grouped(experiment: Experiment) -> Iterator[tuple[str, np.ndarray]]:
    groups = experiment.groups
    for label in sorted({str(g) for g in groups if g}, key=_natural):
        yield label, np.flatnonzero(groups == label)


def _natural(label: str) -> tuple:
    """Sorts 'column 2' before 'column 10'."""
    digits = ''.join(c if c.isdigit() else ' ' for c in label).split()
    return (label.rstrip('0123456789'), int(digits[-1]) if digits else 0, label)


def _strips(experiment: Experiment) -> Iterator[_Line]:
    """Strips that cross the passes, each with about as many readings."""
    members = np.arange(len(experiment))
    if not len(members):
        return
    height_m, across_m = _axes(experiment, members)
    upright = passes_are_level(experiment.path, experiment.surface.down)
    aside = across_m if upright else height_m
    count = int(np.clip(round(len(members) / READINGS_A_STRIP), 1, MOST_STRIPS))
    for part in np.array_split(np.argsort(aside, kind='stable'), count):
        ends = 1e3 * aside[part].min(), 1e3 * aside[part].max()
        what = 'across' if upright else 'height'
        label = f'{what} {ends[0]:.0f} to {ends[1]:.0f} mm' if count > 1 else 'all readings'
        yield _Line.along_strip(experiment, label, members[part], upright)


def _films_along(
    experiment: Experiment, lines: Sequence[_Line], models: Sequence[DepositionModel]
) -> dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """By label of a line: positions, films of the models, and film of each pass alone."""
    if not lines:
        return {}
    along_lines = [_along(experiment, line) for line in lines]
    cuts = np.cumsum([len(at) for at, _, _ in along_lines])
    count = int(cuts[-1])
    slopes = any(effect.needs_slope for model in models for effect in model.effects)
    points = experiment.surface.at(
        np.concatenate([places_m for _, places_m, _ in along_lines]),
        np.concatenate([normals for _, _, normals in along_lines]),
        stencil_m=STENCIL_M if slopes else None,
    )
    films = np.array([_gauge_um(experiment, points, model)[:count] for model in models])
    passes = np.array(list(_single_passes_um(experiment, points, models[-1])))[:, :count]
    found = {}
    for line, (at, _, _), stop in zip(lines, along_lines, cuts, strict=True):
        here = slice(int(stop) - len(at), int(stop))
        found[line.label] = at, films[:, here], passes[:, here]
    return found


def _along(experiment: Experiment, line: _Line) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions along the axis, points near the surface and normals, through all places."""
    at = line.position_m
    steps = max(2, int(np.ceil((at[-1] - at[0]) / LINE_STEP_M)) + 1)
    wanted = np.unique(np.concatenate([np.linspace(at[0], at[-1], steps), at]))
    along = [
        np.column_stack([np.interp(wanted, at, column[:, k]) for k in range(3)])
        for column in (line.places_m, experiment.points.normals[line.members])
    ]
    return wanted, along[0], along[1]


def _gauge_um(experiment: Experiment, points: SurfacePoints, model: DepositionModel) -> np.ndarray:
    integrator = FilmIntegrator(points, model, 'double', experiment.surface.occluder)
    integrator.add(experiment.path)
    return integrator.gauge_um


def _single_passes_um(
    experiment: Experiment, points: SurfacePoints, model: DepositionModel
) -> Iterator[np.ndarray]:
    """Paint that arrives from each pass alone: the others are kept, with the gun off."""
    path: SprayPath = experiment.path
    integrator = FilmIntegrator(points, model, 'double', experiment.surface.occluder)
    for number in np.unique(path.spray_pass[path.spray_pass >= 0]):
        inside = path.spray_pass == number
        integrator.reset()
        integrator.add(path.with_flow_scaled(inside))
        yield integrator.raw_um


def _nothing(models: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return np.empty(0), np.empty((models, 0)), np.empty((0, 0))
