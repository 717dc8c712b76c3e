"""Waiting for what another thread or process does; `wait_until` of conftest runs nodes, too."""

import time
from collections.abc import Callable


def until(
    condition: Callable[[], object], what: str,
    meanwhile: Callable[[], None] = lambda: time.sleep(0.02), timeout_s: float = 60.0,
) -> None:  # fmt: skip
    """Return once it holds, which must be within a minute or the time that is given."""
    deadline = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline, f'{what} did not come within {timeout_s:.0f} s'
        meanwhile()
