"""Texts that are filled in from a template beside the code that writes them."""

from pathlib import Path
from typing import Any


def filled(template: Path, **values: Any) -> str:
    """A text file by its Jinja template, from these values as they are; each must be there."""
    from jinja2 import StrictUndefined, Template

    text = template.read_text(encoding='utf-8')
    made = Template(
        text, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        keep_trailing_newline=True,
    )  # fmt: skip
    return made.render(values)
