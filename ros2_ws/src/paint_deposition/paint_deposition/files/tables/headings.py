"""Headings of columns: their words and their units."""

import re
import unicodedata
from dataclasses import dataclass

# Metres in a unit of length, and the same for times, angles and speeds, by the ways to write it.
LENGTHS = {
    'm': 1.0, 'cm': 1e-2, 'mm': 1e-3, 'inch': 25.4e-3, 'in': 25.4e-3, 'zoll': 25.4e-3,
    **dict.fromkeys(('um', 'μm', 'micron', 'microns', 'mikrometer', 'micrometer'), 1e-6),
    **dict.fromkeys(('micrometers', 'micrometre', 'micrometres'), 1e-6),
    **dict.fromkeys(('mil', 'mils', 'thou'), 25.4e-6),
}  # fmt: skip
TIMES = {'s': 1.0, 'sec': 1.0, 'ms': 1e-3, 'us': 1e-6, 'μs': 1e-6, 'ns': 1e-9}
ANGLES = {'rad': 1.0, 'deg': 0.0174532925199432957, '°': 0.0174532925199432957}
SPEEDS = {'m/s': 1.0, 'mm/s': 1e-3}
UNITS = LENGTHS | TIMES | ANGLES | SPEEDS
# The name of a unit of length in messages, by its metres.
UNIT_NAMES = {1.0: 'm', 1e-2: 'cm', 1e-3: 'mm', 1e-6: 'µm', 25.4e-6: 'mil', 25.4e-3: 'inch'}


@dataclass(frozen=True)
class Heading:
    """A heading as written, its words without the unit, and the unit ('' for none)."""

    text: str
    words: tuple[str, ...]
    unit: str = ''

    @staticmethod
    def of(text: str) -> 'Heading':
        """'X [mm]', 'x_mm', 'DFT, µm', 'Dicke in µm' and '/pose/orientation/w' are understood.

        A text in brackets that is no known unit stays as the unit, for the reader to refuse.
        """
        text = text.strip().lstrip('#%').strip()
        small = re.sub(r'[\s_](mm?)_per_s$', r' [\1/s]', _small(text))
        if bracketed := re.search(r'[\[(]\s*([^\])]*?)\s*[\])]', small):
            rest = small[: bracketed.start()] + ' ' + small[bracketed.end() :]
            return Heading(text, words_of(rest), bracketed[1])
        words = words_of(small)
        if len(words) > 1 and words[-1] in UNITS:
            return Heading(text, tuple(w for w in words[:-1] if w != 'in'), words[-1])
        return Heading(text, words)

    @property
    def unit_m(self) -> float | None:
        """Metres in its unit, None where it has no unit of length."""
        return LENGTHS.get(self.unit)


def words_of(text: str) -> tuple[str, ...]:
    """The words of a text, small and without accents; '#' counts as one."""
    return tuple(re.findall(r'[^\W_]+|#', _small(text)))


def length_of(text: str) -> float | None:
    """Metres in a unit of length that stands alone, None where it is none."""
    return LENGTHS.get(_small(text).strip(' .[]()'))


def unit_of(text: str) -> str:
    """What stands in a row of units, as a heading has its unit."""
    return _small(text).strip(' .[]()-–—')


def _small(text: str) -> str:
    text = unicodedata.normalize('NFKD', unicodedata.normalize('NFKC', text).casefold())
    return ''.join(letter for letter in text if not unicodedata.combining(letter))
