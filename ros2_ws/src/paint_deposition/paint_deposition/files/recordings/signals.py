"""A signal of the cell: a number or Bool in a field of any message, and when it means on."""

from __future__ import annotations

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
    """What is meant by ``/io.states[3]``, ``/io.level > 12`` or ``/io.closed < 1``.

    ``path`` is '' for a message that has one field, ``data``; ``level`` is that beyond which, or
    ``below`` which, it is on.
    """

    topic: str
    path: str
    below: bool = False
    level: float = 0.0

    @staticmethod
    def of(text: str) -> Signal | None:
        """The signal that a text names, None if it names none; a wrong level is refused."""
        parsed = SYNTAX.fullmatch(text.strip())
        if parsed is None:
            return None
        try:
            level = float(parsed['level'] or 0.0)
        except ValueError:
            raise RecordingError(
                f"{text}: '{parsed['level']}' is no number; give a level, 12 say"
            ) from None
        return Signal(parsed['topic'], parsed['path'], parsed['side'] == '<', level)

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
        """Whether a value, or each of an array, means on."""
        return values < self.level if self.below else values > self.level
