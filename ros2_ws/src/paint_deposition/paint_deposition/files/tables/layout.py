"""What the user says of a table of readings."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Layout:
    """What the user says of a table; what is left out is found.

    Attributes:
        columns: heading, or number from 1, of a quantity's column.
        unit: metres in the unit of 'position' and of 'thickness'.
        decimal: '.' or ',', or '' where it is to be found.
        sheet: name of a workbook's sheet, or ''.
    """

    columns: Mapping[Any, str | int] = field(default_factory=dict)
    unit: Mapping[Any, float] = field(default_factory=dict)
    decimal: str = ''
    sheet: str = ''
