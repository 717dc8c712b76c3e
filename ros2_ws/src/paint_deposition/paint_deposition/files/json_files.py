"""Figures as JSON that every reader takes: no NaN, no half-written file."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pydantic_core import to_json, to_jsonable_python

from paint_deposition.files.atomic import write_text


def write_json(path: str | Path, content: Mapping[str, Any]) -> None:
    """Write JSON, whole or not at all; see ``json_text``."""
    write_text(path, json_text(content) + '\n')


def json_text(content: Mapping[str, Any]) -> str:
    """JSON with arrays as lists and paths as text; numbers that are not finite become null."""
    return to_json(content, indent=2, inf_nan_mode='null', fallback=_without_numpy).decode()


def plain(value: Any) -> Any:
    """Numbers and containers of Python for those of NumPy; other values raise ValueError."""
    return to_jsonable_python(value, fallback=_without_numpy)


def _without_numpy(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise ValueError(f'{type(value).__name__} cannot be written as JSON')
