"""The table of a trade-off."""

from collections.abc import Sequence
from dataclasses import astuple, fields
from pathlib import Path

from paint_deposition.files.gauge_readings import write_table
from paint_deposition.planning.trade_off import Point


def write_trade_off_table(path: str | Path, points: Sequence[Point]) -> Path:
    """One row a weight."""
    rows = [[f'{value:.6g}' for value in astuple(point)] for point in points]
    write_table(path, [[item.name for item in fields(Point)], *rows])
    return Path(path)
