"""Headings of columns: their words and their units."""

import re
import unicodedata
from dataclasses import dataclass

# The ways to write a unit, by its metres, seconds, radians, or metres a second.
WAYS_TO_WRITE: dict[str, dict[float, str]] = {
    'length': {
        1.0: 'm meter meters metre metres',
        1e-2: 'cm centimeter centimeters centimetre centimetres zentimeter',
        1e-3: 'mm millimeter millimeters millimetre millimetres',
        25.4e-3: 'inch inches in zoll',
        1e-6: 'um μm micron microns mikrometer micrometer micrometers micrometre micrometres',
        25.4e-6: 'mil mils thou',
    },
    'time': {
        1.0: 's sec seconds sekunden sek', 1e-3: 'ms msec milliseconds millisekunden',
        1e-6: 'us μs microseconds mikrosekunden', 1e-9: 'ns nanoseconds nanosekunden',
    },
    'angle': {1.0: 'rad radian radians', 0.0174532925199432957: 'deg ° degree degrees grad'},
    'speed': {1.0: 'm/s', 1e-3: 'mm/s'},
}  # fmt: skip
LENGTHS, TIMES, ANGLES, SPEEDS = (
    {word: factor for factor, words in ways.items() for word in words.split()}
    for ways in WAYS_TO_WRITE.values()
)
UNITS = LENGTHS | TIMES | ANGLES | SPEEDS
# The first way to write a unit, by all of them.
SHORT = {
    word: words.split()[0]
    for ways in WAYS_TO_WRITE.values() for words in ways.values() for word in words.split()
}  # fmt: skip
# The name of a unit of length in messages, by its metres.
UNIT_NAMES = {1.0: 'm', 1e-2: 'cm', 1e-3: 'mm', 1e-6: 'µm', 25.4e-6: 'mil', 25.4e-3: 'inch'}
# What a heading says of a coordinate beside its axis. A nominal one counts if there is no other.
NOMINAL = {'nominal', 'nom', 'soll', 'cad', 'design'}
BESIDE = {
    'pos', 'position', 'coordinate', 'coordinates', 'koordinate', 'koordinaten', 'lage', 'act',
    'actual', 'ist', 'measured', 'gemessen',
}  # fmt: skip
BRACKETED = re.compile(r'[\[(]\s*([^\])]*?)\s*[\])]')


@dataclass(frozen=True)
class Heading:
    """A heading as written, its words without the unit, and the unit ('' for none)."""

    text: str
    words: tuple[str, ...]
    unit: str = ''

    @staticmethod
    def of(text: str) -> 'Heading':
        """'X [mm]', 'x_mm', 'DFT, µm', 'Dicke in µm' and '/pose/orientation/w' are understood.

        A text in brackets that is no known unit, and says no more than 'actual', stays as the
        unit, for the reader to refuse.
        """
        text = text.strip().lstrip('#%').strip()
        small = re.sub(r'[\s_](mm?)_per_s$', r' [\1/s]', _small(text))
        bracketed = BRACKETED.findall(small)
        known = [unit for unit in bracketed if unit in UNITS]
        strange = [unit for unit in bracketed if not {*words_of(unit)} <= BESIDE | NOMINAL]
        if units := known or strange:
            rest = BRACKETED.sub(lambda b: ' ' if b[1] == units[0] else b[0], small)
            return Heading(text, words_of(rest), SHORT.get(units[0], units[0]))
        words = words_of(small)
        if len(words) > 1 and words[-1] in UNITS:
            return Heading(text, tuple(w for w in words[:-1] if w != 'in'), SHORT[words[-1]])
        return Heading(text, words)

    @property
    def unit_m(self) -> float | None:
        """Metres in its unit, None where it has no unit of length."""
        return LENGTHS.get(self.unit)


def words_of(text: str) -> tuple[str, ...]:
    """The words of a text, small and without accents; '#' counts as one."""
    spaced = re.sub(r'(?<=[\u3040-\u9fff])(?=\d)', ' ', _small(text))  # 測定値1
    return tuple(re.findall(r'[^\W_]+|#', spaced))


def length_of(text: str) -> float | None:
    """Metres in a unit of length that stands alone, None where it is none."""
    return LENGTHS.get(_small(text).strip(' .[]()'))


def unit_of(text: str) -> str:
    """What stands in a row of units, as a heading has its unit."""
    unit = _small(text).strip(' .[]()-–—')
    return SHORT.get(unit, unit)


def _small(text: str) -> str:
    text = unicodedata.normalize('NFKD', unicodedata.normalize('NFKC', text).casefold())
    return ''.join(letter for letter in text if not unicodedata.combining(letter))
