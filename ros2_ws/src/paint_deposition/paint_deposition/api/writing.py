"""What the command line writes for each result: figures, meshes, pictures and the report."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

# Kind of result, the module of `writers` that writes it, and its function: a script loads only
# what its own results need.
WRITERS = {
    'Film': ('films', 'film'),
    'Calibration': ('fits', 'calibration'),
    'Comparison': ('fits', 'comparison'),
    'SideBySide': ('fits', 'side_by_side'),
    'Diagnosis': ('fits', 'diagnosis'),
    'Recommendation': ('plans', 'recommendation'),
    'Plan': ('plans', 'plan'),
    'PartPlan': ('plans', 'plan'),
    'Improvement': ('plans', 'improvement'),
    'ChosenReadings': ('plans', 'chosen_readings'),
}


def write(result: Any, folder: str | Path, **more: Any) -> list[Path]:
    """Write a result as its command does, replacing older files of the same names.

    Args:
        result: what a verb of this package returned.
        folder: where to; made if it is not there.
        start: of a calibration or a diagnosis, the ``ModelFile`` that it started from: its name,
            history and uncertainties are carried on.
        made_from: of a film, a plan, an improvement, chosen points or a recommendation, more to
            say in its figures, such as the files used.
        parquet: of a film, whether its table is also written as film.parquet, to the last bit.
        model: of a recommendation, what it was computed with.
        part_pose, frame_id: of a plan or an improvement, where the part stands in the robot's
            frame, [x y z qx qy qz qw], and the name of that frame; its files have their poses in
            that frame then. The first of them also of chosen points.
        drawing: of a film, a plan, a comparison or a diagnosis, the ``DrawingProcess`` that draws
            its picture meanwhile.
        trade_off: of plan or improvement, ``Point``s of other weights of the paint, for a table
            and a picture.

    Returns:
        The paths written.
    """
    kind = type(result).__name__
    if kind not in WRITERS:
        raise TypeError(f'{kind} is not a result that can be written')
    module, function = WRITERS[kind]
    writers = import_module(f'paint_deposition.api.writers.{module}')
    return getattr(writers, function)(result, folder, **more)
