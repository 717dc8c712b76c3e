"""How plans and recommendations are written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from paint_deposition.api.writers.provenance import input_files, provenance, with_provenance
from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.files.json_files import write_json
from paint_deposition.film.spray_geometry import spray_geometry
from paint_deposition.inference.diagnosis.reading_choice import ChosenReadings
from paint_deposition.motion.part_frame import Rigid
from paint_deposition.planning.improvement.improvement import Improvement
from paint_deposition.planning.part_plan import PartPlan
from paint_deposition.planning.plan import Plan
from paint_deposition.planning.recommendation import Recommendation
from paint_deposition.planning.trade_off import Point
from paint_deposition.report.drawing import HERE, DrawingProcess, Here
from paint_deposition.report.writers.improvement import write_improvement
from paint_deposition.report.writers.measuring import write_chosen_readings
from paint_deposition.report.writers.plan import write_plan
from paint_deposition.report.writers.trade_off import write_trade_off_table

PNG = 'png'
# What a robot's own frame is called where nobody says (REP-105 and most URDFs).
ROBOT_FRAME = 'base_link'


def recommendation(
    result: Recommendation,
    folder: str | Path,
    made_from: Mapping[str, Any] | None = None,
    model: DepositionModel | None = None,
    pictures: str = PNG,
) -> list[Path]:
    files = [Path(folder) / 'recommendation.json', Path(folder) / f'uniformity.{pictures}']
    write_json(files[0], result.to_dict() | provenance(model, input_files(made_from or {})))
    HERE.start('uniformity:write_uniformity', files[1], result).result()
    return files


def plan(
    result: Plan | PartPlan,
    folder: str | Path,
    made_from: Mapping[str, Any] | None = None,
    part_pose: Sequence[float] | None = None,
    frame_id: str = ROBOT_FRAME,
    pictures: str = PNG,
    trade_off: Sequence[Point] = (),
    drawing: DrawingProcess | Here = HERE,
) -> list[Path]:
    of_part = {'down': result.surface.down, 'notes': result.surface.notes}
    about = with_provenance(of_part | dict(made_from or {}), result.model)
    part = None if part_pose is None else (frame_id, Rigid.of(part_pose))
    film = drawing.start(
        'film:write_film_picture', Path(folder) / f'film.{pictures}', result.surface,
        result.film_um, result.path, result.statistics, 'Planned passes and their film',
        result.sentence,
    )  # fmt: skip
    files = write_plan(folder, result, result.surface, about, part)
    if isinstance(result, PartPlan):
        # The film is seen from one side, the passes from three. That they lie aside of the one
        # side that a part usually has is not odd here.
        geometry = spray_geometry(result.surface, result.path, result.model, frame_id)
        geometry = replace(geometry, warnings=tuple(map(str, result.contacts)))
        files.append(Path(folder) / f'passes.{pictures}')
        drawing.start(
            'geometry:write_geometry_picture', files[-1], result.surface, result.path, geometry,
            'Planned passes over the faces',
        ).result()  # fmt: skip
        return [*files, film.result()]
    plain, weighed = result.plain or result, []
    if trade_off:
        weighed = _write_trade_off(Path(folder), plain.point, trade_off, pictures, drawing)
    return [*files, film.result(), *weighed]


def improvement(
    result: Improvement,
    folder: str | Path,
    made_from: Mapping[str, Any] | None = None,
    part_pose: Sequence[float] | None = None,
    frame_id: str = ROBOT_FRAME,
    pictures: str = PNG,
    trade_off: Sequence[Point] = (),
) -> list[Path]:
    notes = {'notes': (*result.surface.notes, *result.given.notes)}
    about = with_provenance(notes | dict(made_from or {}), result.model)
    part = None if part_pose is None else (frame_id, Rigid.of(part_pose))
    files = write_improvement(folder, result, about, part)
    picture = Path(folder) / f'improvement.{pictures}'
    # The result has the model in it, with effects that another process may not know.
    files.append(HERE.start('improvement:write_improvement_picture', picture, result).result())
    if trade_off:
        files += _write_trade_off(Path(folder), result.points[0], trade_off, pictures, HERE)
    return files


def _write_trade_off(
    folder: Path,
    given: Point,
    points: Sequence[Point],
    pictures: str,
    drawing: DrawingProcess | Here,
) -> list[Path]:
    """Table and picture of other weights of the paint."""
    picture = folder / f'pareto.{pictures}'
    drawn = drawing.start('trade_off:write_trade_off', picture, given, points)
    return [write_trade_off_table(folder / 'pareto.csv', points), drawn.result()]


def chosen_readings(
    result: ChosenReadings,
    folder: str | Path,
    made_from: Mapping[str, Any] | None = None,
    part_pose: Sequence[float] | None = None,
    pictures: str = PNG,
) -> list[Path]:
    of_part = {'down': result.surface.down, 'notes': result.surface.notes}
    about = with_provenance(of_part | dict(made_from or {}), result.model)
    part = None if part_pose is None else Rigid.of(part_pose)
    files = write_chosen_readings(folder, result, about, part)
    picture = Path(folder) / f'points.{pictures}'
    return [
        *files,
        HERE.start('measuring_points:write_measuring_picture', picture, result).result(),
    ]
