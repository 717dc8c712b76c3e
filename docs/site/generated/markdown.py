"""Pieces of Markdown."""

from collections.abc import Iterable, Sequence


def table(headings: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table; a bar in a cell is written so that it ends no cell."""
    lines = [headings, ['---'] * len(headings), *rows]
    return ''.join(
        f'| {" | ".join(str(cell).replace("|", "&#124;") for cell in line)} |\n' for line in lines
    )


def definitions(entries: Iterable[tuple[str, str]]) -> str:
    """A list of terms, each with its definition."""
    return '\n'.join(f'`{term}`\n:   {text}\n' for term, text in entries)


def code(text: str, language: str = 'text') -> str:
    """A block as it is."""
    return f'```{language}\n{text.strip()}\n```\n'


def prose(docstring: str) -> str:
    """A docstring as Markdown."""
    return docstring.replace('``', '`')
