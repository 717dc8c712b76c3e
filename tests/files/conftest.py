"""What readers of several kinds of files are tried on."""

from collections.abc import Callable
from pathlib import Path

import pytest


@pytest.fixture
def file(tmp_path: Path) -> Callable[..., Path]:
    """`file(name, text, encoding)`: the path of a new file."""

    def write(name: str, text: str, encoding: str = 'utf-8') -> Path:
        path = tmp_path / name
        path.write_bytes(text.encode(encoding))
        return path

    return write
