"""All complaints of a file at once, in one line."""

from pathlib import Path

from paint_deposition.errors import ReadingsError

MOST_SHOWN = 8


class Complaints:
    """What is wrong in the lines of a file.

    Args:
        path: of the file.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._found: dict[int, str] = {}

    def at(self, line: int, text: str) -> None:
        """Note what is wrong in a line; the first of a line counts, others may follow from it."""
        self._found.setdefault(line, text)

    def of_file(self, text: str) -> ReadingsError:
        """What is wrong with the file as a whole, as an error to raise."""
        return ReadingsError(f'{self._path}: {text}')

    def refuse_any(self) -> None:
        """Refuse the file if anything is wrong in it.

        Raises:
            ReadingsError: with every complaint and its line, up to a number.
        """
        if not self._found:
            return
        lines = [f'line {line}: {text}' for line, text in sorted(self._found.items())]
        shown, more = lines[:MOST_SHOWN], len(lines) - MOST_SHOWN
        rest = f'; and {more} more' if more > 0 else ''
        count = f'{len(lines)} complaints: ' if len(lines) > 1 else ''
        raise self.of_file(f'{count}{"; ".join(shown)}{rest}')
