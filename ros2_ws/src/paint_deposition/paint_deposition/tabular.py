"""Results as tables: data frames of pandas."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from paint_deposition.errors import PaintError

if TYPE_CHECKING:
    import pandas as pd


class Tabular:
    """A result with columns."""

    def columns(self) -> Mapping[str, Sequence[Any] | Any]:
        """The columns of the table, all of one length, by name."""
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
