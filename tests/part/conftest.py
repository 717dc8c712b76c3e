"""Surfaces of known shape as fixtures."""

from collections.abc import Callable

import numpy as np
import pytest

from paint_deposition.part.surface import Surface
from surfaces import Depth, triangulated


@pytest.fixture
def make_surface() -> Callable[..., Surface]:
    """Builder of refined surfaces y = depth(x, z); see ``triangulated``."""

    def build(depth: Depth, spacing_m: float, max_edge_length_m: float = 0.01, **shape) -> Surface:
        return Surface.from_triangles(*triangulated(depth, spacing_m, **shape), max_edge_length_m)

    return build


@pytest.fixture
def triangles() -> Callable[..., tuple[np.ndarray, np.ndarray]]:
    """The builder ``triangulated``."""
    return triangulated


@pytest.fixture
def flat() -> Depth:
    """A plane."""
    return lambda x, z: np.zeros_like(x)


@pytest.fixture
def cylinder() -> Callable[[float], Depth]:
    """Part of a level cylinder of signed radius [m], bulging toward the gun if positive."""
    return lambda radius_m: (
        lambda x, z: np.sign(radius_m) * (abs(radius_m) - np.sqrt(radius_m**2 - z**2))
    )


@pytest.fixture
def ball() -> Callable[[float], Depth]:
    """Part of a ball of signed radius [m], bulging toward the gun if positive."""
    return lambda radius_m: (
        lambda x, z: np.sign(radius_m) * (abs(radius_m) - np.sqrt(radius_m**2 - x**2 - z**2))
    )


@pytest.fixture
def fold() -> Callable[[float], Depth]:
    """Two planes that meet at z = 0 and each lean back by an angle [rad]; negative: a groove."""
    return lambda lean_rad: lambda x, z: np.abs(z) * np.tan(lean_rad)
