"""Waiting for what another thread or process does; `wait_until` of conftest runs nodes, too."""

import time
from collections.abc import Callable

PATIENCE_S = 60.0


def until(condition: Callable[[], object], what: str) -> None:
    """Return once it holds, which must be within a minute."""
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, f'{what} did not come within {PATIENCE_S:.0f} s'
        time.sleep(0.02)
