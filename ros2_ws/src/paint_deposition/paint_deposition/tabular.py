"""Results as tables: data frames for scripts, and a few rows for notebooks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from paint_deposition.errors import PaintError

if TYPE_CHECKING:
    import pandas as pd


class Tabular:
    """A result with columns, and with a few rows that say the most of it."""

    def columns(self) -> Mapping[str, Sequence[Any] | Any]:
        """The columns of the table, all of one length, by name."""
        raise NotImplementedError

    def short_table(self) -> list[Sequence[Any]]:
        """A heading and a few rows."""
        raise NotImplementedError

    def to_dataframe(self) -> pd.DataFrame:
        """The table as a data frame of pandas.

        Raises:
            PaintError: pandas is not installed.
        """
        try:
            import pandas as pd
        except ImportError:
            raise PaintError(
                'a data frame needs pandas, which is not installed; run: pip install pandas'
            ) from None
        return pd.DataFrame(dict(self.columns()))

    def _repr_html_(self) -> str:
        """What a notebook shows."""
        head, *rows = [
            ''.join(f'<td>{escape(str(cell))}</td>' for cell in row) for row in self.short_table()
        ]
        body = ''.join(f'<tr>{row}</tr>' for row in rows)
        head = head.replace('td>', 'th>')
        return (
            f'<table><caption>{escape(repr(self))}</caption><thead><tr>{head}</tr></thead>'
            f'<tbody>{body}</tbody></table>'
        )
