"""Signals of the cell: a number or Bool in a field of any message, and when it is on."""

import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from paint_deposition.errors import RecordingError

SYNTAX = re.compile(
    r'(?P<topic>[\w/~]+)(?P<path>(\.\w+|\[\d+\])*)\s*((?P<side>[<>])\s*(?P<level>[-+.\deE]+))?'
)
STEP = re.compile(r'\.(\w+)|\[(\d+)\]')


@dataclass(frozen=True)
class Signal:
    """A signal such as ``/io.states[3]``, ``/io.level > 12`` or ``/io.closed < 1``.

    ``path`` of the field is '' for the field ``data`` of std_msgs. The signal is on above
    ``level``, or under it if ``below`` is set.
    """

    topic: str
    path: str
    below: bool = False
    level: float = 0.0

    @staticmethod
    def parse(text: str) -> 'Signal | None':
        """Parse a signal, None for other text; raises RecordingError for an invalid level."""
        match = SYNTAX.fullmatch(text.strip())
        if match is None:
            return None
        try:
            level = float(match['level'] or 0.0)
        except ValueError:
            raise RecordingError(
                f"{text}: '{match['level']}' is no number; give a level such as 12"
            ) from None
        return Signal(match['topic'], match['path'], match['side'] == '<', level)

    def value(self, message: Any) -> float | None:
        """The number in a message, None where there is none."""
        value = message
        # The messages of std_msgs have one field.
        try:
            for name, index in STEP.findall(self.path) or [('data', '')]:
                value = getattr(value, name) if name else value[int(index)]
        except (AttributeError, IndexError, TypeError):
            return None
        known = isinstance(value, bool | int | float | np.bool_ | np.number)
        return float(value) if known else None

    def is_on(self, values: Any) -> Any:
        """Whether the signal is on at a value, or at each of an array."""
        return values < self.level if self.below else values > self.level
