"""What goes to a worker, as bytes: with the text of a user's own effects, which it has not."""

import io
import pickle
from typing import Any

import numpy as np

from paint_deposition.effects.base import Effect
from paint_deposition.effects.user_effects import effect_of


class _Packer(pickle.Pickler):
    def reducer_override(self, value: Any) -> Any:
        if isinstance(value, type) and issubclass(value, Effect) and value.file is not None:
            return effect_of, (value.file, value.file_content)
        return NotImplemented


class _ByValue(_Packer):
    def reducer_override(self, value: Any) -> Any:
        if isinstance(value, np.ndarray) and not value.dtype.hasobject:
            return np.ndarray, (value.dtype.str, value.shape, value.tobytes())
        return super().reducer_override(value)


def packed(value: Any) -> bytes:
    """Bytes that ``pickle.loads`` opens in another process; a user's own effects are run there."""
    return _bytes(_Packer, value)


def told_by_value(value: Any) -> bytes:
    """The same bytes for the same content: of arrays how they lie in memory does not count."""
    return _bytes(_ByValue, value)


def _bytes(packer: type[_Packer], value: Any) -> bytes:
    content = io.BytesIO()
    packer(content, protocol=5).dump(value)
    return content.getvalue()
