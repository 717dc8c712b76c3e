"""Figures as JSON that every reader takes: no NaN, no half-written file."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from paint_deposition.files.atomic import write_text


def write_json(path: str | Path, content: Mapping[str, Any]) -> None:
    """Write JSON, whole or not at all; see ``json_text``."""
    write_text(path, json_text(content) + '\n')


def json_text(content: Mapping[str, Any]) -> str:
    """JSON with arrays as lists and paths as text; numbers that are not finite become null.

    Raises:
        TypeError: a value that JSON cannot hold.
    """
    return json.dumps(_plain(content), indent=2, allow_nan=False)


def _plain(value: Any) -> Any:
    """The value in types that JSON knows."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Path):
        return str(value)
    return value
