"""Errors that a user can act on: one line naming the thing, its value and the remedy."""

import difflib
from collections.abc import Iterable, Sequence

# Letters in a message: of a value, and of what a library says is wrong.
LONGEST_QUOTED, LONGEST_REASON = 60, 120


class PaintError(Exception):
    """Base of every error this package raises on purpose; its text is shown to the user as is."""


class MeshError(PaintError):
    """The part's mesh cannot be used."""


class RecordingError(PaintError):
    """A bag, topic or pose stream cannot be used."""


class ModelError(PaintError):
    """A deposition model, its file or one of its effects is not valid."""


class ReadingsError(PaintError):
    """Gauge readings or a campaign cannot be used."""


class BatchError(PaintError):
    """A sweep over cases cannot be run."""


def some(names: Sequence[str], most: int) -> str:
    """'a, b and 3 more': so many of the names at most, for a message."""
    more = f' and {len(names) - most} more' if len(names) > most else ''
    return ', '.join(map(shortened, names[:most])) + more


def quoted(value: object) -> str:
    """A value for a message, cut where it is long: it may be the content of another file."""
    return shortened(repr(value))


def shortened(text: str, most: int = LONGEST_QUOTED) -> str:
    """A text for a message: in one line, and of so many letters."""
    text = ' '.join(text[: 10 * most].split())
    return text if len(text) <= most else f'{text[: most - 3]}...'


def did_you_mean(name: object, known: Iterable[str], otherwise: str = '') -> str:
    """The remedy for an unknown name.

    Args:
        name: what was given.
        known: what could have been meant.
        otherwise: what to say where none of these looks like it; default: list them all.
    """
    known = list(known)
    # A forgotten unit is likelier than a wrong letter: K1 is meant for K1_cm3_per_s, not K2.
    near = [other for other in known if other.lower().startswith(f'{name}_'.lower())]
    # Names less alike than this share are not taken for each other.
    near = near or difflib.get_close_matches(str(name), known, n=1, cutoff=0.4)
    if near:
        return f'did you mean {near[0]!r}?'
    return otherwise or f'there are: {some(known, 40) or "none"}'
