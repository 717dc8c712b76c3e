"""Numbers as people and gauges write them: decimal comma, thousands, a unit behind."""

import re
import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass

from paint_deposition.files.tables.sheets import Cell

MARKS = {'.': 'point', ',': 'comma'}
NUMBER = re.compile(r'(?P<number>[+-]?[\d.,](?:[\d.,\'’ ]*[\d.,])?(?:[eE][+-]?\d+)?)(?P<rest>.*)')
PLAIN = re.compile(r'[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?')
# Cells with which a gauge says that it has no reading.
NOTHING = re.compile(r'[-–—.*]*|n\.?/?a\.?|#n/a|none|null', re.IGNORECASE)


@dataclass(frozen=True)
class Decimals:
    """How a table writes its numbers.

    Attributes:
        mark: '.' or ','.
        doubt: what the reader must decide, for a complaint; '' where nothing is in doubt.
    """

    mark: str
    doubt: str = ''

    @staticmethod
    def among(cells: Iterable[tuple[int, Cell]]) -> 'Decimals':
        """The mark that the (line, cell) of numbers have in common."""
        seen: dict[str, str] = {}
        unsure = ''
        for line, cell in cells:
            split = None if isinstance(cell, float) else _split(cell)
            if split is None:
                continue
            mark = _mark_in(split[0])
            if mark in MARKS:
                seen.setdefault(mark, f"'{cell}' in line {line}")
            elif mark == '?' and ',' in split[0] and not unsure:
                unsure = f"'{cell}' in line {line}"
        if len(seen) > 1:
            doubt = f'decimal point ({seen["."]}) and decimal comma ({seen[","]}) are mixed'
            return Decimals('.', f'{doubt}; write one of them')
        if not seen and unsure:
            doubt = f'{unsure} may have a decimal comma or a comma between thousands'
            return Decimals(',', f'{doubt}; say which with decimal: comma or decimal: point')
        return Decimals(next(iter(seen), '.'))

    def number(self, cell: Cell) -> tuple[float, str] | None:
        """The number in a cell and the text behind it, its unit; None where there is none."""
        if isinstance(cell, float):
            return cell, ''
        if cell.lower().lstrip('+-') in ('nan', 'inf', 'infinity'):
            return float(cell), ''
        split = _split(cell)
        if split is None:
            return None
        digits, rest = split
        other = ',' if self.mark == '.' else '.'
        whole, _, fraction = digits.partition(self.mark)
        if other in digits:
            if not re.fullmatch(rf'[+-]?\d{{1,3}}(\{other}\d{{3}})+', whole) or other in fraction:
                return None
            digits = digits.replace(other, '')
        digits = digits.replace(self.mark, '.')
        return (float(digits), rest) if PLAIN.fullmatch(digits) else None


def is_nothing(cell: Cell) -> bool:
    """Whether a cell is blank or says that there is no reading."""
    return not isinstance(cell, float) and NOTHING.fullmatch(cell) is not None


def _split(text: str) -> tuple[str, str] | None:
    """The digits with their marks, without blanks between thousands, and the text behind."""
    text = unicodedata.normalize('NFKC', text).replace('−', '-')
    found = NUMBER.fullmatch(text.strip())
    if found is None:
        return None
    digits = found['number']
    if re.search(r"['’ ]", digits):
        if not re.fullmatch(r"[+-]?\d{1,3}(['’ ]\d{3})+([.,]\d*)?", digits):
            return None
        digits = re.sub(r"['’ ]", '', digits)
    return digits, found['rest'].strip()


def _mark_in(digits: str) -> str:
    """'.' or ',' where the digits leave no doubt, '?' where they do, '' without a mark."""
    used = [mark for mark in MARKS if mark in digits]
    if not used:
        return ''
    if len(used) == 2:
        return max(used, key=digits.rfind)
    if digits.count(used[0]) > 1:  # thousands, or a date
        other = ',' if used[0] == '.' else '.'
        return other if re.fullmatch(r'[+-]?\d{1,3}([.,]\d{3})+', digits) else ''
    if re.fullmatch(r'[+-]?[1-9]\d{0,2}[.,]\d{3}', digits):
        return '?'
    return used[0]
