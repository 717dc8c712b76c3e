"""Set-points that stand in the place of a brush's number, between calibrated brushes."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import ModelError
from paint_deposition.model.brush import (
    BETWEEN,
    MOST_BETWEEN,
    SETTINGS,
    Brush,
    BrushLaw,
    SetPoints,
    listed,
)
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.motion.trigger import ONLY_BRUSH

WHERE = 'set-points of the atomizer'


def uses_set_points(model: DepositionModel, brush: int, set_points: Sequence[float]) -> bool:
    """Whether set-points say which of several brushes sprays, and no number does."""
    unnamed = brush == ONLY_BRUSH or brush >= BETWEEN
    return unnamed and len(model.brushes) > 1 and any(value > 0.0 for value in set_points)


def with_set_points(
    model: DepositionModel, set_points: Sequence[float]
) -> tuple[DepositionModel, int]:
    """A model of several brushes with the one that set-points stand for, and its number.

    Set-points are in the order of SETTINGS; those that are not above 0 are not known.

    Raises:
        ModelError: they lie outside the calibrated brushes, or one is missing.
    """
    given = zip(SETTINGS, set_points, strict=True)
    known = {name: float(value) for name, value in given if value > 0.0}
    calibrated = tuple(brush for brush in model.brushes if not brush.interpolated)
    wanted = SetPoints.model_construct(None, **known)
    # First, for it refuses what lies outside and what is missing.
    planar = BrushLaw(calibrated).pattern(WHERE, wanted)
    for brush in model.brushes:
        if all(getattr(brush, name) == value for name, value in known.items()):
            return model, brush.number
    number = max(BETWEEN, model.brushes[-1].number + 1)
    if number >= BETWEEN + MOST_BETWEEN:
        raise ModelError(
            f'{WHERE} have changed to {MOST_BETWEEN} other values: give what is set, not what is '
            'measured, or the number of the brush'
        )
    paint = {
        name: getattr(calibrated[0], name)
        for name in ('solids', 'density_g_per_cm3')
        if len({getattr(brush, name) for brush in calibrated}) == 1
    }
    new = Brush(number=number, planar=planar, interpolated=True, **known, **paint)
    return model.model_copy(update={'brushes': (*model.brushes, new)}), number


def with_brushes_of(model: DepositionModel, before: DepositionModel) -> DepositionModel:
    """A model with the brushes that set-points stood for before, by the same numbers.

    Raises:
        ModelError: they lie outside its calibrated brushes.
    """
    there = {brush.number for brush in model.brushes}
    old = [b for b in before.brushes if b.number >= BETWEEN and b.number not in there]
    if not old or len(model.brushes) <= 1:
        return model
    law = BrushLaw(tuple(brush for brush in model.brushes if not brush.interpolated))
    new = (b.model_copy(update={'planar': law.pattern(WHERE, b.set_points)}) for b in old)
    return model.model_copy(update={'brushes': (*model.brushes, *new)})


def with_interpolated_brushes(
    trajectory: Trajectory, model: DepositionModel
) -> tuple[Trajectory, DepositionModel]:
    """A motion with the brushes that its set-points stand for, and the model that has them.

    Raises:
        ModelError: naming the motion, where they lie outside the calibrated brushes.
    """
    if not len(trajectory.trigger_set_points):
        return trajectory, model
    brushes = [brush for *_, brush in trajectory.triggers]
    for row, set_points in enumerate(trajectory.trigger_set_points.tolist()):
        if trajectory.trigger_flow[row] > 0.0 and uses_set_points(model, brushes[row], set_points):
            try:
                model, brushes[row] = with_set_points(model, set_points)
            except ModelError as error:
                raise ModelError(f'{trajectory.source}: {error}') from None
    used = [number for number in dict.fromkeys(brushes) if number >= BETWEEN]
    numbers = listed(brush.number for brush in model.brushes)
    note = (
        f'{trajectory.source}: states name no brush; their set-points lie between brushes '
        f'{numbers} ({len(used)} different)'
    )
    return replace(
        trajectory,
        trigger_brush=np.array(brushes, dtype=np.int64),
        notes=(*trajectory.notes, note) if used else trajectory.notes,
    ), model
