"""How plans and recommendations are written."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.files.json_files import write_json
from paint_deposition.files.provenance import origin
from paint_deposition.film.spray_geometry import spray_geometry
from paint_deposition.inference.diagnosis.reading_choice import ChosenReadings
from paint_deposition.motion.part_frame import Rigid
from paint_deposition.planning.improvement.improvement import Improvement
from paint_deposition.planning.part_plan import PartPlan
from paint_deposition.planning.plan import Plan
from paint_deposition.planning.recommendation import Recommendation
from paint_deposition.report.pictures.film import write_film_picture
from paint_deposition.report.pictures.inference import write_measuring_picture
from paint_deposition.report.pictures.motion import write_geometry_picture
from paint_deposition.report.pictures.planning import (
    write_improvement_picture,
    write_uniformity,
)
from paint_deposition.report.writers.measuring import write_chosen_readings
from paint_deposition.report.writers.passes import write_plan
from paint_deposition.report.writers.write import input_files, with_provenance, written

# What a robot's own frame is called where nobody says (REP-105 and most URDFs).
ROBOT_FRAME = 'base_link'


@written.register
def _recommendation(
    result: Recommendation,
    folder: str | Path,
    made_from: Mapping[str, Any] | None = None,
    model: DepositionModel | None = None,
    pictures: str = 'png',
) -> list[Path]:
    files = [Path(folder) / 'recommendation.json', Path(folder) / f'uniformity.{pictures}']
    write_json(
        files[0], result.to_dict() | {'provenance': origin(model, input_files(made_from or {}))}
    )
    write_uniformity(files[1], result)
    return files


@written.register(Plan)
@written.register(PartPlan)
def _plan(
    result: Plan | PartPlan,
    folder: str | Path,
    made_from: Mapping[str, Any] | None = None,
    part_pose: Sequence[float] | None = None,
    frame_id: str = ROBOT_FRAME,
    pictures: str = 'png',
) -> list[Path]:
    of_part = {'down': result.surface.down, 'notes': result.surface.notes}
    about = with_provenance(of_part | dict(made_from or {}), result.model)
    part = None if part_pose is None else (frame_id, Rigid.of(part_pose))
    files = write_plan(folder, result, about, part)
    film = write_film_picture(
        Path(folder) / f'film.{pictures}', result.surface, result.film_um, result.path,
        result.statistics, 'Planned passes and their film', result.sentence,
    )  # fmt: skip
    if isinstance(result, PartPlan):
        # The film is seen from one side, the passes from three. That they lie aside of the one
        # side that a part usually has is not odd here.
        geometry = spray_geometry(result.surface, result.path, result.model, frame_id)
        geometry = replace(geometry, warnings=tuple(map(str, result.contacts)))
        files.append(Path(folder) / f'passes.{pictures}')
        write_geometry_picture(
            files[-1], result.surface, result.path, geometry, 'Planned passes over the faces'
        )
        return [*files, film]
    return [*files, film]


@written.register
def _improvement(
    result: Improvement,
    folder: str | Path,
    made_from: Mapping[str, Any] | None = None,
    part_pose: Sequence[float] | None = None,
    frame_id: str = ROBOT_FRAME,
    pictures: str = 'png',
) -> list[Path]:
    notes = {'notes': (*result.surface.notes, *result.given.notes)}
    about = with_provenance(notes | dict(made_from or {}), result.model)
    part = None if part_pose is None else (frame_id, Rigid.of(part_pose))
    files = write_plan(folder, result, about, part)
    picture = Path(folder) / f'improvement.{pictures}'
    return [*files, write_improvement_picture(picture, result)]


@written.register
def _chosen_readings(
    result: ChosenReadings,
    folder: str | Path,
    made_from: Mapping[str, Any] | None = None,
    part_pose: Sequence[float] | None = None,
    pictures: str = 'png',
) -> list[Path]:
    of_part = {'down': result.surface.down, 'notes': result.surface.notes}
    about = with_provenance(of_part | dict(made_from or {}), result.model)
    part = None if part_pose is None else Rigid.of(part_pose)
    files = write_chosen_readings(folder, result, about, part)
    picture = Path(folder) / f'points.{pictures}'
    return [*files, write_measuring_picture(picture, result)]
