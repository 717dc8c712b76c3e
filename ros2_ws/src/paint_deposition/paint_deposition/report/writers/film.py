"""A finished film on disk, for node and command: painted mesh, table and figures."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from paint_deposition.errors import PaintError
from paint_deposition.files.atomic import replacing
from paint_deposition.files.json_files import write_json
from paint_deposition.files.meshes import write_mesh_ply
from paint_deposition.files.parquet import write_parquet
from paint_deposition.film.colour_scales import film_scale
from paint_deposition.film.statistics import FilmStatistics
from paint_deposition.part.surface import Surface

CSV_HEADER = 'x_m,y_m,z_m,thickness_um'
CSV_ROW = '%.9g,%.9g,%.9g,%.9g\n'
CSV_ROWS = 4096


def write_film(
    folder: str | Path,
    surface: Surface,
    film_um: np.ndarray,
    statistics: FilmStatistics,
    *,
    stem: str = 'film',
    statistics_file: str = 'stats.json',
    details: Mapping[str, Any] | None = None,
    color_range_um: tuple[float, float] = (0.0, 0.0),
    overwrite: bool = False,
) -> list[Path]:
    """Write ``<stem>.ply``, ``<stem>.csv`` and the statistics, each file whole or not at all.

    Args:
        folder: where to; made if it is not there.
        film_um: (V,) film at the vertices of the surface [um].
        details: more to say in the statistics, such as counts of poses and the files used.
        color_range_um: ends of the colour map in the PLY [um]; both 0 is automatic.
        overwrite: whether older files of these names may go.

    Returns:
        The absolute paths written, in the order above.

    Raises:
        PaintError: a file of that name is there, or the folder cannot be written.
    """
    folder = Path(folder).expanduser().absolute()
    paths = [folder / f'{stem}.ply', folder / f'{stem}.csv', folder / statistics_file]
    for path in paths:
        if path.exists() and not overwrite:
            raise PaintError(
                f'{path} is there already; choose another name, or move the old file away'
            )
    with writable(folder):
        shown = film_um > statistics.painted_above_um
        colours = film_scale(film_um, *color_range_um).rgba(film_um, shown)
        write_mesh_ply(paths[0], surface, colours, thickness_um=film_um)
        with replacing(paths[1]) as temporary:
            _write_rows(temporary, np.column_stack([surface.vertices_m, film_um]))
        write_json(paths[2], {**statistics.to_dict(), **(details or {})})
    return paths


def write_film_table(path: Path, surface: Surface, film_um: np.ndarray) -> Path:
    """Write the film at the vertices as Parquet, to the last bit, whole or not at all.

    The columns of the CSV, and what a mean over the surface needs: ``nx``, ``ny``, ``nz``, the
    outward unit normal, and ``area_m2``, the share of the surface that belongs to the vertex.
    """
    import pyarrow as pa

    named = zip(('x_m', 'y_m', 'z_m'), surface.vertices_m.T, strict=True)
    normals = zip(('nx', 'ny', 'nz'), surface.normals.T, strict=True)
    columns = {**dict(named), 'thickness_um': film_um, **dict(normals)}
    columns['area_m2'] = surface.vertex_areas_m2
    return write_parquet(path, pa.table(columns))


def _write_rows(path: Path, rows: np.ndarray) -> None:
    """As ``np.savetxt`` does, three times as fast: many rows are formatted at once."""
    with path.open('w', encoding='ascii', newline='\n') as file:
        file.write(f'{CSV_HEADER}\n')
        for first in range(0, len(rows), CSV_ROWS):
            some = rows[first : first + CSV_ROWS]
            file.write(CSV_ROW * len(some) % tuple(some.ravel().tolist()))


@contextmanager
def writable(folder: Path) -> Iterator[None]:
    """Give PaintError for what keeps files from being written to a folder."""
    try:
        yield
    except OSError as error:
        raise PaintError(
            f'{error.filename or folder}: {error.strerror}; choose a folder that can be written'
        ) from None
