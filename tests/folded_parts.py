"""Parts with several sides: a hood with a flange, and a bumper that wraps round its corners."""

from collections.abc import Callable

import numpy as np

from paint_deposition.part.surface import Surface
from surfaces import on_grid

Profile = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


def bent(straight_m: float, radius_m: float, angle_rad: float) -> Profile:
    """Along and down (2, N) of a line that is straight, turns down by the angle, and goes on."""

    def places(way_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        turned = np.clip((way_m - straight_m) / radius_m, 0.0, angle_rad)
        rest = np.clip(way_m - straight_m - radius_m * angle_rad, 0.0, None)
        along = np.minimum(way_m, straight_m) + radius_m * np.sin(turned)
        down = radius_m * (1.0 - np.cos(turned))
        return along + rest * np.cos(angle_rad), down + rest * np.sin(angle_rad)

    return places


def hood(spacing_m: float = 0.04, flange_m: float = 0.18) -> Surface:
    """A hood of 1 x 0.8 m that lies; its front, toward +y, is turned down by 80 degrees."""
    angle, radius = np.radians(80.0), 0.04
    profile = bent(0.8, radius, angle)
    way = _steps(0.8 + radius * angle + flange_m, spacing_m)
    x, way = np.meshgrid(_steps(1.0, spacing_m) - 0.5, way, indexing='ij')
    y, down = profile(way)
    return _surface(np.stack([x, y, 0.9 - down - 0.1 * x**2], axis=-1))


def bumper(spacing_m: float = 0.04, wing_m: float = 0.2) -> Surface:
    """A bumper 0.4 m high, 1 m wide toward -y, its wings turned back by 85 degrees."""
    angle, radius = np.radians(85.0), 0.15
    profile = bent(0.35, radius, angle)
    length = 0.35 + radius * angle + wing_m
    way, z = np.meshgrid(
        _steps(2.0 * length, spacing_m) - length, _steps(0.4, spacing_m), indexing='ij'
    )
    aside, back = profile(np.abs(way))
    return _surface(np.stack([np.sign(way) * aside, back, z], axis=-1))


def _steps(length_m: float, spacing_m: float) -> np.ndarray:
    return np.linspace(0.0, length_m, round(length_m / spacing_m) + 1)


def _surface(grid_m: np.ndarray) -> Surface:
    return Surface.from_triangles(*on_grid(grid_m), 1.0)
