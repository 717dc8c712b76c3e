"""Names of files and folders that come from outside."""

from __future__ import annotations

import re

from paint_deposition.errors import PaintError

FILE_NAME = re.compile(r'[A-Za-z0-9_-][A-Za-z0-9._-]*')
FILE_NAME_WORDS = "letters, digits, '-', '_' and '.', the last not in front"


def require_file_name(what: str, name: str) -> None:
    """Refuse a name that could lead to another folder.

    Raises:
        PaintError: it is empty, or has other characters than files of a cell need.
    """
    if not FILE_NAME.fullmatch(name):
        raise PaintError(f"{what} '{name}': use {FILE_NAME_WORDS}")
