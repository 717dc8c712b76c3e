"""Whatever is refused is told in one line."""

import pytest


def refusal(kind: type[Exception], act, *arguments, **options) -> str:
    """The line with which this is refused."""
    with pytest.raises(kind) as refused:
        act(*arguments, **options)
    line = str(refused.value)
    assert '\n' not in line
    return line
