"""Parts as analytic surfaces y = f(x, z), z up, the gun on the +y side, and their meshes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

OUTLINE_MARGIN_M = 0.15


@dataclass(frozen=True)
class Bend:
    """A line along which the slope changes by `slope`, spread over about 4 x `soft_m`.

    The side where direction x (coordinate - at) > 0 falls away from the gun if slope < 0 (convex).
    """

    axis: str
    at_m: float
    direction: float
    slope: float
    soft_m: float

    def height(self, coordinate: np.ndarray) -> np.ndarray:
        u = self.direction * (coordinate - self.at_m) / self.soft_m
        return self.slope * self.soft_m * np.logaddexp(0.0, u)

    def first(self, coordinate: np.ndarray) -> np.ndarray:
        u = self.direction * (coordinate - self.at_m) / self.soft_m
        return self.slope * self.direction * 0.5 * (1.0 + np.tanh(0.5 * u))

    def second(self, coordinate: np.ndarray) -> np.ndarray:
        u = self.direction * (coordinate - self.at_m) / self.soft_m
        return self.slope / (4.0 * self.soft_m) / np.cosh(np.clip(0.5 * u, -50, 50)) ** 2


@dataclass(frozen=True)
class Part:
    """A sheet over -width/2 <= x <= width/2 (left side slanted by `taper_m`), 0 <= z <= height."""

    kind: str
    width_m: float
    height_m: float
    crown_x_m: float = np.inf
    crown_z_m: float = np.inf
    twist: float = 0.0
    taper_m: float = 0.0
    bends: tuple[Bend, ...] = ()
    obstacle: tuple[np.ndarray, np.ndarray] | None = field(default=None, compare=False)

    def height(self, x: np.ndarray, z: np.ndarray) -> np.ndarray:
        """y of the surface (metres)."""
        zc = z - 0.5 * self.height_m
        y = -(x**2) / (2 * self.crown_x_m) - zc**2 / (2 * self.crown_z_m) + self.twist * x * zc
        for bend in self.bends:
            y = y + bend.height(x if bend.axis == 'x' else z)
        return y

    def slope(self, x: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(dy/dx, dy/dz)."""
        zc = z - 0.5 * self.height_m
        y_x = -x / self.crown_x_m + self.twist * zc
        y_z = -zc / self.crown_z_m + self.twist * x
        for bend in self.bends:
            if bend.axis == 'x':
                y_x = y_x + bend.first(x)
            else:
                y_z = y_z + bend.first(z)
        return y_x, y_z

    def point(self, x: np.ndarray, z: np.ndarray) -> np.ndarray:
        x, z = np.broadcast_arrays(x, z)
        return np.stack([x, self.height(x, z), z], axis=-1).astype(float)

    def normal(self, x: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Unit normals toward the gun, shape (..., 3)."""
        y_x, y_z = self.slope(x, z)
        n = np.stack(np.broadcast_arrays(-y_x, np.ones_like(y_x + y_z), -y_z), axis=-1)
        return n / np.linalg.norm(n, axis=-1, keepdims=True)

    def curvature(self, x: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Principal curvatures (low, high) in 1/m, exact, positive where concave to the gun."""
        y_x, y_z = self.slope(x, z)
        y_xx = np.full_like(y_x + y_z, -1.0 / self.crown_x_m)
        y_zz = np.full_like(y_xx, -1.0 / self.crown_z_m)
        for bend in self.bends:
            if bend.axis == 'x':
                y_xx = y_xx + bend.second(x)
            else:
                y_zz = y_zz + bend.second(z)
        w2 = 1.0 + y_x**2 + y_z**2
        twice_mean = (1 + y_z**2) * y_xx - 2 * y_x * y_z * self.twist + (1 + y_x**2) * y_zz
        mean = twice_mean / (2 * w2**1.5)
        gauss = (y_xx * y_zz - self.twist**2) / w2**2
        root = np.sqrt(np.maximum(mean**2 - gauss, 0.0))
        return mean - root, mean + root

    def curvature_over(self, x, z, reach_m: float) -> tuple[np.ndarray, np.ndarray]:
        """Principal curvatures averaged over a disc of `reach_m`: a field does not see a point."""
        low, high = self.curvature(x, z)
        low, high, count = low.copy(), high.copy(), 1
        for radius in (0.5 * reach_m, reach_m):
            for angle in np.arange(8) * np.pi / 4:
                around = self.curvature(x + radius * np.cos(angle), z + radius * np.sin(angle))
                low, high, count = low + around[0], high + around[1], count + 1
        return low / count, high / count

    def left(self, z: np.ndarray) -> np.ndarray:
        return -0.5 * self.width_m + self.taper_m * np.asarray(z) / self.height_m

    def edge_distance(self, x: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Distance to the nearest free edge seen from the front (negative outside), metres."""
        lean = np.hypot(1.0, self.taper_m / self.height_m)
        beside = 0.5 * self.width_m - x, (x - self.left(z)) / lean
        return np.minimum.reduce([*beside, z + 0.0 * x, self.height_m - z + 0.0 * x])

    def mesh(self, edge_m: float = 0.012) -> tuple[np.ndarray, np.ndarray]:
        """Vertices (v, 3), faces (f, 3): surface, normals to the gun, and what is before it."""
        columns = int(np.ceil(self.width_m / edge_m)) + 1
        rows = int(np.ceil(self.height_m / (0.6 * edge_m))) + 1
        z = np.linspace(0.0, self.height_m, rows)[:, None]
        share = np.linspace(0.0, 1.0, columns)[None, :]
        x = self.left(z) + share * (0.5 * self.width_m - self.left(z))
        vertices = self.point(x, z + 0.0 * x).reshape(-1, 3)
        i = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)[None, :]).ravel()
        lower, upper = (i, i + columns, i + 1), (i + 1, i + columns, i + columns + 1)
        faces = np.concatenate([np.stack(lower, 1), np.stack(upper, 1)])
        if self.obstacle is None:
            return vertices, faces
        more, extra = self.obstacle
        return np.concatenate([vertices, more]), np.concatenate([faces, extra + len(vertices)])


def draw_door(rng: np.random.Generator) -> Part:
    """A door with a convex line near the middle and a concave lower third, as in the paper."""
    height = rng.uniform(0.70, 1.00)
    ridge_slope, ridge_radius = rng.uniform(0.10, 0.28), rng.uniform(0.08, 0.25)
    hollow_slope, hollow_radius = rng.uniform(0.20, 0.45), rng.uniform(0.15, 0.40)
    ridge_at, hollow_at = height * rng.uniform(0.48, 0.64), height * rng.uniform(0.22, 0.34)
    bends = [
        Bend('z', ridge_at, -1.0, -ridge_slope, ridge_slope * ridge_radius / 4),
        Bend('z', hollow_at, -1.0, hollow_slope, hollow_slope * hollow_radius / 4),
    ]
    width = rng.uniform(0.90, 1.30)
    if rng.random() < 0.4:
        slope = rng.choice([-1.0, 1.0]) * rng.uniform(0.06, 0.16)
        radius = rng.uniform(0.10, 0.30)
        at, side = width * rng.uniform(-0.3, 0.3), rng.choice([-1.0, 1.0])
        bends.append(Bend('x', at, side, slope, abs(slope) * radius / 4))
    crowns = rng.uniform(3.0, 8.0), rng.uniform(1.5, 4.0)
    twist, taper = rng.uniform(-0.04, 0.04), rng.uniform(0.0, 0.08)
    return Part('door', width, height, *crowns, twist, taper, tuple(bends))


def flat_panel(width_m: float, height_m: float) -> Part:
    return Part('panel', width_m, height_m)
