"""Headers of messages, whoever decoded them."""

from typing import Any


def stamp_ns(header: Any) -> int:
    """A header's stamp in integer nanoseconds, which a float could not hold."""
    return header.stamp.sec * 1_000_000_000 + header.stamp.nanosec
