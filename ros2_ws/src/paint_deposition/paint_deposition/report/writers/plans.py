"""How plans, improved programmes, recommendations and chosen points are written."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.files.gauge_readings import write_table
from paint_deposition.files.json_files import write_json
from paint_deposition.files.planned_model import DIGEST, IMPROVEMENT_FILE, PLAN_FILE
from paint_deposition.files.provenance import model_digest, origin
from paint_deposition.film.spray_geometry import spray_geometry
from paint_deposition.inference.design.reading_choice import ChosenReadings
from paint_deposition.motion.part_frame import Rigid
from paint_deposition.part.orientation import across_axis
from paint_deposition.planning.improvement.improvement import Improvement
from paint_deposition.planning.part_place import PartPlaces
from paint_deposition.planning.part_plan import PartPlan
from paint_deposition.planning.plan import Plan
from paint_deposition.planning.recommendation import Recommendation
from paint_deposition.report.pictures.chart import save_picture
from paint_deposition.report.pictures.film import film_picture
from paint_deposition.report.pictures.inference import write_measuring_picture
from paint_deposition.report.pictures.motion import write_geometry_picture
from paint_deposition.report.pictures.planning import (
    write_improvement_picture,
    write_places,
    write_uniformity,
)
from paint_deposition.report.writers.film import write_film
from paint_deposition.report.writers.passes import Passes, write_passes
from paint_deposition.report.writers.write import input_files, with_provenance, written

# What a robot's own frame is called where nobody says (REP-105 and most URDFs).
ROBOT_FRAME = 'base_link'
COLUMNS = (
    'point', 'x_m', 'y_m', 'z_m', 'nx', 'ny', 'nz', 'thickness_um', 'from_left_mm', 'height_mm',
    'expected_um', 'speaks_for',
)  # fmt: skip


@written.register
def _recommendation(
    result: Recommendation,
    folder: Path,
    made_from: Mapping[str, Any] | None = None,
    model: DepositionModel | None = None,
    pictures: str = 'png',
) -> list[Path]:
    files = [folder / 'recommendation.json', folder / f'uniformity.{pictures}']
    provenance = origin(model, input_files(made_from or {}))
    write_json(files[0], result.to_dict() | {'provenance': provenance})
    write_uniformity(files[1], result)
    return files


@written.register(Plan)
@written.register(PartPlan)
@written.register(Improvement)
def _passes(
    result: Plan | PartPlan | Improvement,
    folder: Path,
    made_from: Mapping[str, Any] | None = None,
    part_pose: Sequence[float] | None = None,
    frame_id: str = ROBOT_FRAME,
    paint_moves: bool = False,
    pictures: str = 'png',
) -> list[Path]:
    surface, improved = result.surface, isinstance(result, Improvement)
    made, name = ('Improved', IMPROVEMENT_FILE) if improved else ('Planned', PLAN_FILE)
    part = None if part_pose is None else (frame_id, Rigid.of(part_pose))
    passes = Passes(
        result.trajectory, result.moves, result.model, made, part, result.drive, paint_moves,
    )  # fmt: skip
    files = [folder / one for one in (name, *write_passes(folder, passes))]
    given = result.original.notes if isinstance(result, Improvement) else ()
    part_facts = {'down': surface.down, 'notes': (*surface.notes, *given)}
    about = with_provenance(part_facts | dict(made_from or {}), result.model)
    write_json(files[0], {**result.to_dict(), DIGEST: model_digest(result.model), **about})
    zones = result.wanted.zones
    files += write_film(
        folder, surface, result.film_um, result.statistics, zones=zones, overwrite=True
    )
    if isinstance(result, Improvement):
        return [*files, write_improvement_picture(folder / f'improvement.{pictures}', result)]
    film = film_picture(
        surface, result.film_um, result.path, result.statistics, 'Planned passes and their film',
        result.sentence, zones,
    )  # fmt: skip
    if isinstance(result, PartPlan):
        # The film is seen from one side, the passes from three. That they lie aside of the one
        # side that a part usually has is not odd here.
        geometry = spray_geometry(surface, result.path, result.model, frame_id)
        geometry = replace(geometry, warnings=tuple(map(str, result.contacts)))
        files.append(folder / f'passes.{pictures}')
        title = 'Planned passes over the faces'
        write_geometry_picture(files[-1], surface, result.path, geometry, title)
    return [*files, save_picture(film, folder / f'film.{pictures}')]


@written.register
def _part_places(
    result: PartPlaces,
    folder: Path,
    made_from: Mapping[str, Any] | None = None,
    pictures: str = 'png',
) -> list[Path]:
    files = [folder / n for n in ('place.json', 'places.csv', f'place.{pictures}')]
    write_json(files[0], result.to_dict() | with_provenance(dict(made_from or {}), None))
    rows = np.ndindex(result.reached.shape)
    table = [
        (result.x_m[k], result.y_m[i], result.reached[i, k], result.speed[i, k], result.room[i, k])
        for i, k in rows
    ]
    head = [('x_m', 'y_m', 'reached', 'speed', 'room')]
    write_table(files[1], [*head, *([f'{v:.6g}' for v in row] for row in table)])
    write_places(files[2], result)
    return files


@written.register
def _chosen_readings(
    result: ChosenReadings,
    folder: Path,
    made_from: Mapping[str, Any] | None = None,
    part_pose: Sequence[float] | None = None,
    pictures: str = 'png',
) -> list[Path]:
    """Figures, ``points.csv`` to be filled in and read as gauge readings, and a robot's poses.

    With ``part_pose`` the poses are in the robot's frame.
    """
    of_part = {'down': result.surface.down, 'notes': result.surface.notes}
    about = with_provenance(of_part | dict(made_from or {}), result.model)
    part = None if part_pose is None else Rigid.of(part_pose)
    files = [folder / n for n in ('measure.json', 'points.csv', 'poses.csv')]
    positions, quaternions = result.positions_m, _gauge_quaternions(result)
    write_json(files[0], result.to_dict() | about)
    write_table(files[1], _points(result))
    write_table(files[2], _poses(result.names, positions, quaternions, part))
    return [*files, write_measuring_picture(folder / f'points.{pictures}', result)]


def _gauge_quaternions(chosen: ChosenReadings) -> np.ndarray:
    """(P, 4) x, y, z, w: the gauge's z axis into the surface, its x axis level to the right."""
    into = -chosen.normals
    right = across_axis(chosen.surface.outward, chosen.surface.down)
    across = right - (into @ right)[:, np.newaxis] * into
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return Rotation.from_matrix(np.stack([across, np.cross(into, across), into], 2)).as_quat()


def _points(chosen: ChosenReadings) -> Iterator[Sequence[object]]:
    """A line a reading: all points once, then those that are read twice."""
    yield COLUMNS
    face_mm = 1e3 * chosen.from_edges_m
    for k in [*range(len(chosen)), *chosen.read_twice]:
        place = (*chosen.positions_m[k], *chosen.normals[k])
        yield [
            chosen.names[k], *(f'{value:.4f}' for value in place), '',
            *(f'{value:.0f}' for value in face_mm[k]), f'{chosen.expected_um[k]:.1f}',
            ' '.join(chosen.speaks_for[k]),
        ]  # fmt: skip


def _poses(
    names: Sequence[str], positions_m: np.ndarray, quaternions: np.ndarray, part: Rigid | None
) -> Iterator[Sequence[object]]:
    yield 'point', 'x_m', 'y_m', 'z_m', 'qx', 'qy', 'qz', 'qw'
    for name, *pose in zip(names, positions_m, quaternions, strict=True):
        position, quaternion = part.applied(*pose) if part else pose
        yield [name, *(f'{v:.6f}' for v in position), *(f'{v:.8f}' for v in quaternion)]
