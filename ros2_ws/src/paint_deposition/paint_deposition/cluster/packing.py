"""What goes to a worker, as bytes: with the text of a user's own effects, which it has not."""

import io
import pickle
from typing import Any

from paint_deposition.effects.base import Effect
from paint_deposition.effects.user_effects import effect_of


class _Packer(pickle.Pickler):
    def reducer_override(self, value: Any) -> Any:
        if isinstance(value, type) and issubclass(value, Effect) and value.file is not None:
            return effect_of, (value.file, value.file_content)
        return NotImplemented


def packed(value: Any) -> bytes:
    """Bytes that ``pickle.loads`` opens in another process; a user's own effects are run there."""
    content = io.BytesIO()
    _Packer(content, protocol=5).dump(value)
    return content.getvalue()
