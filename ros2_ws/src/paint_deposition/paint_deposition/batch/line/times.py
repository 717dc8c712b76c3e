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
    columns = ('part', 'time_s', 'named_s', 'remark')
    rows = list(zip(*(table[name].to_pylist() for name in columns), strict=True))
    names_at: dict[float, dict[str, float | None]] = defaultdict(dict)
    for part, time_s, named_s, _ in rows:
        if time_s is not None:
            names_at[time_s][part] = named_s
    times, remarks = [], []
    for _, time_s, named_s, remark in rows:
        together = names_at[time_s]
        line = ''
        if len(together) > 1 and None not in together.values() and len({*together.values()}) > 1:
            line = f'{len(together)} recordings begin at one time; dated by their names'
            time_s = named_s
        elif len(together) > 1:
            line = (
                f'{len(together)} recordings begin at one time, so the order of their parts is '
                'not known; put the date into their names, such as 2026-11-12_0730'
            )
        times.append(time_s)
        remarks.append('; '.join(filter(None, [remark, line])) if line else remark)
    table = table.drop_columns(['named_s', 'time_s', 'remark'])
    table = table.append_column('time_s', pa.array(times, pa.float64()))
    return table.append_column('remark', pa.array(remarks, pa.string()))
