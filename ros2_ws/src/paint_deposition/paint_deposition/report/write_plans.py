"""Plans, improved programmes, recommendations, places and chosen points on disk."""

import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.errors import PaintError
from paint_deposition.files.atomic import write_json, write_text
from paint_deposition.files.gauge_readings import write_table
from paint_deposition.files.model_file import write_model
from paint_deposition.files.provenance import (
    DIGEST,
    IMPROVEMENT_FILE,
    MODEL_FILE,
    PLAN_FILE,
    model_digest,
)
from paint_deposition.files.rapid.program import module_text
from paint_deposition.files.recordings.bag_files import TRIGGER
from paint_deposition.files.recordings.bags import STATE_TOPIC, write_pose_bag
from paint_deposition.film.spray_geometry import spray_geometry
from paint_deposition.inference.design.reading_choice import ChosenReadings
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.motion.programmed import Move, timed
from paint_deposition.motion.transforms import Rigid, moved
from paint_deposition.part.points import across_axis
from paint_deposition.planning.faces import PartPlan
from paint_deposition.planning.improvement import Improvement
from paint_deposition.planning.part_places import PartPlaces
from paint_deposition.planning.plan import Plan
from paint_deposition.planning.recommendation import Recommendation
from paint_deposition.report.drawing import save_picture
from paint_deposition.report.film_pictures import film_picture
from paint_deposition.report.plan_pictures import (
    write_geometry_picture,
    write_improvement_picture,
    write_places,
    write_uniformity,
)
from paint_deposition.report.readings_pictures import write_measuring_picture
from paint_deposition.report.write import with_provenance, write_film, written

BAG, TABLE, PROGRAM, JOINTS = 'trajectory', 'passes.csv', 'passes.mod', 'joints.csv'


def write_passes(
    folder: Path,
    result: Plan | PartPlan | Improvement,
    part: tuple[str, Rigid] | None = None,
    paint_moves: bool = False,
) -> list[str]:
    """Write bag, ``passes.csv``, ``passes.mod`` and ``model.yaml`` to a folder; their names.

    Args:
        folder: where to; made if it is not there.
        result: the motion in the part's frame, timed and as moves of a robot program.
        part: the robot's frame and the pose of the part in it; bag and table have their poses in
            that frame then, and the program defines its work object so. None: the part's frame.
        paint_moves: whether the program sprays by PaintL and SetBrush.

    Raises:
        PaintError: the folder holds another folder of the bag's name.
        OSError: it cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    digest, moves = model_digest(result.model), result.moves
    if part:
        poses = [part[1].applied(move.position_m, move.quaternion_xyzw) for move in moves]
        moves = [
            replace(move, position_m=position, quaternion_xyzw=quaternion)
            for move, (position, quaternion) in zip(moves, poses, strict=True)
        ]
    _write_bag(folder / BAG, result, part, digest)
    write_table(folder / TABLE, _table(moves))
    made = 'Improved' if isinstance(result, Improvement) else 'Planned'
    head = [f'{made} with the model in {MODEL_FILE}, sha256 {digest}']
    head += [f'WARNING: {contact}' for contact in result.contacts]
    module = module_text(result.moves, head, part[1] if part else None, paint_moves)
    write_text(folder / PROGRAM, module)
    write_model(folder / MODEL_FILE, result.model)
    if not result.drive:
        return [BAG, TABLE, PROGRAM, MODEL_FILE]
    arm = result.drive.arm
    units = np.where(arm.slides, 'm', 'rad')
    names = [f'{name}_{unit}' for name, unit in zip(arm.joints, units, strict=True)]
    rows = [
        [f'{time_s:.4f}', *(f'{value:.7f}' for value in values)]
        for time_s, values in zip(result.drive.seconds, result.drive.joints, strict=True)
    ]
    write_table(folder / JOINTS, [['time_s', *names], *rows])
    return [BAG, TABLE, PROGRAM, MODEL_FILE, JOINTS]


def _table(moves: Sequence[Move]) -> Iterator[Sequence[object]]:
    """A line a move of the TCP: where it ends, how fast, and what the gun does.

    Its pass is that on which it ends, numbered from 1 as a simulation does.
    """
    path, _ = spray_path(timed(moves, gun_known=True))
    steps_m = np.linalg.norm(np.diff([move.position_m for move in moves], axis=0), axis=1)
    middle_m = np.cumsum(steps_m) - 0.5 * steps_m
    row = np.searchsorted(np.cumsum(path.dwell_s * path.speed_m_per_s), middle_m)
    numbers = 1 + np.maximum(path.spray_pass[np.minimum(row, len(path) - 1)], 0)
    yield (
        'pass', 'x_m', 'y_m', 'z_m', 'qx', 'qy', 'qz', 'qw', 'speed_m_per_s', 'spraying', 'flow',
        'brush',
    )  # fmt: skip
    for number, move in zip([1, *numbers.tolist()], moves, strict=True):
        yield [
            number,
            *(f'{value:.6f}' for value in move.position_m),
            *(f'{value:.8f}' for value in move.quaternion_xyzw),
            f'{move.speed_m_per_s:.6g}',
            int(move.spraying),
            f'{move.flow:.6g}' if move.spraying else 0,
            move.brush,
        ]


def _write_bag(
    target: Path,
    result: Plan | PartPlan | Improvement,
    part: tuple[str, Rigid] | None,
    digest: str,
) -> None:
    if target.exists():
        strangers = [
            path for path in target.rglob('*')
            if path.suffix not in ('.mcap', '.yaml') or path.is_dir()
        ]  # fmt: skip
        if not target.is_dir() or strangers:
            raise PaintError(f'{target} is there and no planned bag; move it away')
    trajectory = result.trajectory
    placed = moved(trajectory, part[1], part[0]) if part else trajectory
    # A bag's files are named for their folder, so the folder is made under its own name.
    with tempfile.TemporaryDirectory(dir=target.parent, prefix='.plan-') as aside:
        fresh = write_pose_bag(
            Path(aside) / target.name, placed,
            custom_data={DIGEST: digest, TRIGGER: STATE_TOPIC},
            part=(trajectory.frame_id, part[1]) if part else None, drive=result.drive,
        )  # fmt: skip
        if target.exists():
            shutil.rmtree(target)
        fresh.rename(target)
    write_model(target / MODEL_FILE, result.model)


@written.register
def _recommendation(
    result: Recommendation,
    folder: Path,
    made_from: Mapping[str, Any] | None = None,
    model: DepositionModel | None = None,
    pictures: str = 'png',
) -> list[Path]:
    files = [folder / 'recommendation.json', folder / f'uniformity.{pictures}']
    provenance = with_provenance(made_from or {}, model)['provenance']
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
    frame_id: str = 'base_link',  # as most URDFs have it (REP-105)
    paint_moves: bool = False,
    pictures: str = 'png',
) -> list[Path]:
    surface = result.surface
    name = IMPROVEMENT_FILE if isinstance(result, Improvement) else PLAN_FILE
    part = None if part_pose is None else (frame_id, Rigid.of(part_pose))
    files = [folder / one for one in (name, *write_passes(folder, result, part, paint_moves))]
    given = result.before.trajectory.notes if isinstance(result, Improvement) else ()
    part_facts = {'down': surface.down, 'notes': (*surface.notes, *given)}
    about = with_provenance(part_facts | dict(made_from or {}), result.model)
    write_json(files[0], {**result.to_dict(), DIGEST: model_digest(result.model), **about})
    zones = result.wanted.zones
    laid = result.after if isinstance(result, Improvement) else result
    files += write_film(
        folder, surface, laid.film_um, laid.whole_part, zones=zones, overwrite=True,
        details={'region': 'the painted area of the whole part'},
    )  # fmt: skip
    if isinstance(result, Improvement):
        return [*files, write_improvement_picture(folder / f'improvement.{pictures}', result)]
    film = film_picture(
        surface, result.film_um, result.path, result.whole_part, 'Planned passes and their film',
        result.sentence, zones,
    )  # fmt: skip
    if isinstance(result, PartPlan):
        # The film is seen from one side, the passes from three. That they lie aside of the one
        # side that a part usually has is not odd here.
        geometry = spray_geometry(surface, result.path, result.model)
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
    poses: list[Sequence[object]] = [('point', 'x_m', 'y_m', 'z_m', 'qx', 'qy', 'qz', 'qw')]
    turns = gauge_turns(result.normals, result.surface.outward, result.surface.down)
    for name, *pose in zip(result.names, result.positions_m, turns, strict=True):
        position, quaternion = part.applied(*pose) if part else pose
        poses.append([name, *(f'{v:.6f}' for v in position), *(f'{v:.8f}' for v in quaternion)])
    write_json(files[0], result.to_dict() | about)
    # A line a reading: all points once, then those that are read twice.
    points: list[Sequence[object]] = [(
        'point', 'x_m', 'y_m', 'z_m', 'nx', 'ny', 'nz', 'thickness_um', 'from_left_mm',
        'height_mm', 'expected_um', 'speaks_for',
    )]  # fmt: skip
    for k in [*range(len(result)), *result.read_twice]:
        place = (*result.positions_m[k], *result.normals[k])
        points.append([
            result.names[k], *(f'{value:.4f}' for value in place), '',
            *(f'{1e3 * value:.0f}' for value in result.from_edges_m[k]),
            f'{result.expected_um[k]:.1f}', ' '.join(result.speaks_for[k]),
        ])  # fmt: skip
    write_table(files[1], points)
    write_table(files[2], poses)
    return [*files, write_measuring_picture(folder / f'points.{pictures}', result)]


def gauge_turns(normals: np.ndarray, outward: np.ndarray, down: np.ndarray) -> np.ndarray:
    """(N, 4) turns of a gauge whose z axis looks into the surface, its x axis level to the right.

    Where a normal (N, 3) looks to the right or the left itself, x is that of ``outward`` (3,).
    """
    into, right = -normals, across_axis(outward, down)
    aside = np.abs(into @ right)[:, np.newaxis] > 1.0 - 1e-6
    level = np.where(aside, outward, right)
    across = level - np.sum(into * level, axis=1, keepdims=True) * into
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    axes = np.stack([across, np.cross(into, across), into], axis=2)
    return Rotation.from_matrix(axes).as_quat()
