"""Where a part stands in the frame of the robot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from paint_deposition.errors import RecordingError
from paint_deposition.files.gauge_readings import read_points
from paint_deposition.files.meshes import read_mesh
from paint_deposition.motion.part_frame import Rigid
from paint_deposition.motion.part_location import PartPlace, locate, register

# For distances the surface need not be refined.
UNREFINED_M = 10.0


def locate_by_points(
    touched: str | Path, points: str | Path, unit: str | None = None
) -> PartPlace:
    """The pose of a part from points that the robot touched.

    Args:
        touched: table of named points in the robot's frame.
        points: table of the same points in the part's frame.
        unit: 'm', 'mm' or 'cm' where headings tell none.

    Raises:
        PaintError: the tables cannot be read, or determine no pose.
    """
    given = read_points(Path(touched), unit), read_points(Path(points), unit)
    try:
        return locate(*given)
    except RecordingError as error:
        raise RecordingError(f'{touched} and {points}: {error}') from None


def locate_by_scan(
    scan: str | Path,
    mesh: str | Path,
    start: Sequence[float] | None = None,
    scan_scale: float = 1.0,
    mesh_scale: float = 1.0,
) -> PartPlace:
    """The pose of a part from a scan of it in the robot's frame.

    Args:
        scan, mesh: mesh files. start: pose to begin with, [x y z qx qy qz qw].
        scan_scale, mesh_scale: metres per unit of the files.

    Raises:
        MeshError: a mesh cannot be read.
    """
    from trimesh import Trimesh

    found, part = (
        Trimesh(surface.vertices_m, surface.faces, process=False)
        for surface in (
            read_mesh(scan, scan_scale, UNREFINED_M),
            read_mesh(mesh, mesh_scale, UNREFINED_M),
        )
    )
    return register(found, part, None if start is None else Rigid.of(start))
