"""Named points in a table."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np

from paint_deposition.errors import RecordingError
from paint_deposition.files.pose_tables.reading import PoseTable, read_positions_m

NAMES = ('point', 'name', 'label', 'punkt', 'no', 'nr', 'id', 'number')


def read_points(path: Path, unit: str | None = None) -> dict[str, np.ndarray]:
    """Positions (3,) by name [m], in the order of the table.

    Args:
        path: of a table with a column ``point`` and x, y, z.
        unit: 'm', 'mm' or 'cm' where the headings tell none.

    Raises:
        RecordingError: naming the file, what is wrong and the remedy.
    """
    table = PoseTable.read(path)
    try:
        column = table.headings.find(*NAMES)
        if column is None:
            written = table.headings.written(range(len(table.headings.all)))
            raise RecordingError(f'no names among the columns {written}; give a column point')
        positions, _ = read_positions_m(table, unit)
        names = [row[column] for row in table.rows]
        if '' in names:
            raise RecordingError(f'line {table.lines[names.index("")]}: a point without a name')
        if len({*names}) < len(names):
            (name, _), *_ = Counter(names).most_common(1)
            raise RecordingError(f"two points are called '{name}'; rename one")
        if not np.isfinite(positions).all():
            raise RecordingError('a position is no number')
    except RecordingError as error:
        raise RecordingError(f'{path}: {error}') from None
    return dict(zip(names, positions, strict=True))
