"""Chosen points on disk: a table for the shop floor, poses for a measuring robot, figures."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from paint_deposition.files.atomic import write_text
from paint_deposition.files.gauge_readings import write_table
from paint_deposition.files.json_files import write_json
from paint_deposition.files.rapid.writer import gauge_module_text
from paint_deposition.inference.diagnosis.reading_choice import ChosenReadings
from paint_deposition.motion.part_frame import Rigid
from paint_deposition.part.axes import across_axis
from paint_deposition.report.writers.write import writable

COLUMNS = (
    'point', 'x_m', 'y_m', 'z_m', 'nx', 'ny', 'nz', 'thickness_um', 'from_left_mm', 'height_mm',
    'expected_um', 'speaks_for',
)  # fmt: skip


def write_chosen_readings(
    folder: str | Path,
    chosen: ChosenReadings,
    details: Mapping[str, Any] | None = None,
    part: Rigid | None = None,
) -> list[Path]:
    """Write ``measure.json``, ``points.csv``, ``poses.csv`` and ``points.mod``.

    ``points.csv`` is read as gauge readings once its column ``thickness_um`` is filled.

    Args:
        folder: where to; made if it is not there.
        details: more to say in measure.json, such as the files used.
        part: pose of the part in the robot's frame; poses.csv is in that frame then, and the
            module defines its work object so.

    Returns:
        The paths written.
    """
    folder = Path(folder)
    names = ('measure.json', 'points.csv', 'poses.csv', 'points.mod')
    files = [folder / name for name in names]
    positions, quaternions = chosen.positions_m, gauge_quaternions(chosen)
    with writable(folder):
        folder.mkdir(parents=True, exist_ok=True)
        write_json(files[0], {**chosen.to_dict(), **(details or {})})
        write_table(files[1], _table(chosen))
        write_table(files[2], _poses(chosen.names, positions, quaternions, part))
        write_text(files[3], gauge_module_text(positions, quaternions, part))
    return files


def gauge_quaternions(chosen: ChosenReadings) -> np.ndarray:
    """(P, 4) x, y, z, w: the gauge's z axis into the surface, its x axis level to the right."""
    into = -chosen.normals
    right = across_axis(chosen.surface.outward, chosen.surface.down)
    across = right - (into @ right)[:, np.newaxis] * into
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return Rotation.from_matrix(np.stack([across, np.cross(into, across), into], 2)).as_quat()


def _table(chosen: ChosenReadings) -> Iterator[Sequence[object]]:
    """A line a reading: all points once, then those that are read twice."""
    yield COLUMNS
    face_mm = 1e3 * chosen.from_edges_m
    for k in [*range(len(chosen)), *chosen.read_twice]:
        yield [
            chosen.names[k],
            *(f'{value:.4f}' for value in chosen.positions_m[k]),
            *(f'{value:.4f}' for value in chosen.normals[k]),
            '',
            *(f'{value:.0f}' for value in face_mm[k]),
            f'{chosen.expected_um[k]:.1f}',
            ' '.join(chosen.speaks_for[k]),
        ]


def _poses(
    names: Sequence[str], positions_m: np.ndarray, quaternions: np.ndarray, part: Rigid | None
) -> Iterator[Sequence[object]]:
    yield 'point', 'x_m', 'y_m', 'z_m', 'qx', 'qy', 'qz', 'qw'
    for name, *pose in zip(names, positions_m, quaternions, strict=True):
        position, quaternion = part.applied(*pose) if part else pose
        yield [
            name,
            *(f'{value:.6f}' for value in position),
            *(f'{value:.8f}' for value in quaternion),
        ]
