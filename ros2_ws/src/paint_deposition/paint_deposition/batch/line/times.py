"""When parts were painted, where their recordings do not tell them apart."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pyarrow as pa


def dated(table: pa.Table) -> pa.Table:
    """The table with times ``time_s`` from ``named_s`` where recordings begin at one time.

    A part at such a time is dated by its name if that tells it from the others; else a remark says
    that the order is not known. ``named_s`` is left out.
    """
    import pyarrow as pa

    if 'named_s' not in table.column_names:
        return table
    rows = table.select(['part', 'time_s', 'named_s', 'remark']).to_pylist()
    names_at: dict[float | None, dict[str, float | None]] = defaultdict(dict)
    for row in rows:
        names_at[row['time_s']][row['part']] = row['named_s']
    for row in rows:
        together = names_at[row['time_s']]
        if row['time_s'] is None or len(together) < 2:
            continue
        line = f'{len(together)} recordings begin at one time'
        if None not in together.values() and len({*together.values()}) > 1:
            line += '; dated by their names'
            row['time_s'] = row['named_s']
        else:
            line += (
                ', so the order of their parts is not known; put the date into their names, such '
                'as 2026-11-12_0730'
            )
        row['remark'] = '; '.join(filter(None, [row['remark'], line]))
    for name, kind in (('time_s', pa.float64()), ('remark', pa.string())):
        column = pa.array([row[name] for row in rows], kind)
        table = table.drop_columns([name]).append_column(name, column)
    return table.drop_columns(['named_s'])
