"""Film-thickness readings: where they are taken and what the gauge says."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

from .doors import Part

# Of readings from free edges.
KEEP_OFF_M = 0.015


@dataclass(frozen=True)
class GaugeNoise:
    """sigma = sqrt(floor^2 + (relative T)^2) um per reading, and what real gauges add."""

    floor_um: float = 0.7
    relative: float = 0.01
    heavy_tails: bool = False  # Student t, 4 degrees of freedom, same sigma
    outlier_fraction: float = 0.0  # gross errors of 4 to 10 sigma
    session_offset_um: float = 0.0  # standard deviation of one offset per experiment
    texture: float = 0.0  # the film's own scatter from spot to spot, as a share of it
    level: float = 0.0  # scatter of the parts' mean films, as a share
    slip_fraction: float = 0.0  # readings that are mistyped

    def sigma_um(self, film_um: np.ndarray) -> np.ndarray:
        return np.hypot(self.floor_um, self.relative * film_um)

    def read(self, film_um: np.ndarray, rng: np.random.Generator, offset_um: float) -> np.ndarray:
        """One noisy reading of each film, to the gauge's 0.01 um."""
        shape = np.shape(film_um)
        noise = rng.normal(size=shape)
        tails = rng.standard_t(4, size=shape) / np.sqrt(2.0)
        gross = rng.choice([-1.0, 1.0], shape) * rng.uniform(4.0, 10.0, shape)
        struck = rng.random(shape) < self.outlier_fraction
        noise = np.where(struck, gross, tails if self.heavy_tails else noise)
        reading = film_um + self.sigma_um(film_um) * noise + offset_um
        return np.round(np.maximum(reading, 0.0), 2)


@dataclass(frozen=True)
class Spots:
    """Gauge points on a part, each possibly read more than once."""

    x_m: np.ndarray
    z_m: np.ndarray
    group: np.ndarray  # (s,) str, '' if none
    repeats: np.ndarray  # (s,) how many readings

    @staticmethod
    def at(x_m: np.ndarray, z_m: np.ndarray) -> Spots:
        """Points without a group, each read once."""
        return Spots(x_m, z_m, np.full(x_m.size, ''), np.ones(x_m.size, int))

    def select(self, rows: np.ndarray) -> Spots:
        return Spots(*(column[rows] for column in vars(self).values()))


@dataclass(frozen=True)
class Readings:
    """A table, one row per reading; the last five columns are the shop's secret."""

    point: np.ndarray
    group: np.ndarray
    positions_m: np.ndarray
    normals: np.ndarray
    thickness_um: np.ndarray
    sigma_um: np.ndarray  # the gauge's true sigma there
    film_um: np.ndarray  # true dry film
    expected_um: np.ndarray  # what a noise-free gauge would say
    clean_um: np.ndarray  # the film without the hidden effects
    marks_um: np.ndarray  # (n, hidden) what each hidden effect alone would change

    def select(self, rows: np.ndarray | slice) -> Readings:
        return Readings(*(column[rows] for column in vars(self).values()))


def layout(part: Part, style: str, readings: int, repeats: int, rng: np.random.Generator) -> Spots:
    """`readings` in all, of which `repeats` are second and third visits to some of the points."""
    points = max(readings - repeats, 3)
    if style == 'random':
        x, z = scatter(part, points, rng, KEEP_OFF_M)
        group = np.full(x.size, '')
    else:
        x, z, group = _lines(part, style, points, rng)
    times = np.ones(x.size, int)
    again = rng.permutation(x.size)[: max(int(np.ceil(repeats / 2)), 1)]
    for n in range(repeats):
        times[again[n % again.size]] += 1
    return Spots(x, z, group, times)


def measure(
    spot: np.ndarray, film_um: np.ndarray, expected_um: np.ndarray, noise: GaugeNoise,
    rng: np.random.Generator,
) -> tuple[np.ndarray, float, float]:  # fmt: skip
    """Read (n,) films of another part in another session; repeats share spot and texture.

    What was written down (n,), the part's film over that of its kind, and the gauge's zero [um].
    """
    places, place = np.unique(spot, return_inverse=True)
    level = 1.0 + noise.level * rng.normal()
    offset = noise.session_offset_um * rng.normal()
    texture = 1.0 + noise.texture * rng.normal(size=places.size)[place]
    film = film_um * (level * texture) + (expected_um - film_um)
    reading = noise.read(film, rng, offset)
    slipped = rng.random(spot.size) < noise.slip_fraction
    reading[slipped] = [mistyped(value, rng) for value in reading[slipped]]
    return reading, level, offset


def mistyped(reading_um: float, rng: np.random.Generator) -> float:
    """A slip of the fingers: the point left out (31.2 -> 312), digits swapped, or one wrong."""
    digits = list(f'{reading_um:.1f}')
    kind = rng.choice(['point', 'swapped', 'wrong'])
    if kind == 'point':
        digits.remove('.')
    elif kind == 'swapped' and digits[1] != '.':
        digits[0], digits[1] = digits[1], digits[0]
    else:
        digits[0] = str((int(digits[0]) + int(rng.integers(1, 10))) % 10)
    return float(''.join(digits))


def scatter(part: Part, count: int, rng, keep_off_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Quasi-random points on the surface, away from free edges."""
    cube = qmc.Sobol(2, scramble=True, seed=int(rng.integers(2**31))).random(1024)
    x, z = (cube[:, 0] - 0.5) * part.width_m, cube[:, 1] * part.height_m
    free = part.edge_distance(x, z) > keep_off_m
    return x[free][:count], z[free][:count]


def tabulate(
    part: Part, spots: Spots, film: np.ndarray, expected: np.ndarray, clean: np.ndarray,
    marks: np.ndarray, noise: GaugeNoise, offset: float, rng: np.random.Generator,
) -> Readings:  # fmt: skip
    """One row per reading: first every point once, then the repeats."""
    rounds = [np.flatnonzero(spots.repeats > n) for n in range(spots.repeats.max())]
    row = np.concatenate(rounds)
    names = np.array([f'P{n + 1:03d}' for n in range(spots.x_m.size)])
    at, normals = (of(spots.x_m, spots.z_m) for of in (part.point, part.normal))
    return Readings(
        names[row], spots.group[row], at[row], normals[row],
        noise.read(expected[row], rng, offset), noise.sigma_um(expected[row]), film[row],
        expected[row], clean[row], marks[row],
    )  # fmt: skip


def keep_clear(part: Part, spots: Spots) -> Spots:
    """Where a body on the surface is nearer than 18 mm the gauge cannot stand; leave these out."""
    if part.obstacle is None:
        return spots
    body = part.obstacle[0]
    on_surface = body[np.abs(body[:, 1] - part.height(body[:, 0], body[:, 2])) < 0.02]
    if not on_surface.size:
        return spots
    x, _, z = on_surface.T
    foot = np.hypot(spots.x_m[:, None] - x, spots.z_m[:, None] - z)
    return spots.select(foot.min(axis=1) > 0.018)


def _lines(
    part: Part, style: str, points: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Four or five columns, or five to seven rows, as one tapes them on a door."""
    lines = int(rng.integers(4, 6)) if style == 'columns' else int(rng.integers(5, 8))
    number = np.arange(points) % lines
    place = np.arange(points) // lines
    across = np.linspace(0.08, 0.92, lines)[number]
    each = np.bincount(number, minlength=lines)[number]
    share = place / np.maximum(each - 1, 1)
    room = KEEP_OFF_M + 0.001
    name, aside, up = ('column', across, share) if style == 'columns' else ('row', share, across)
    z = room + up * (part.height_m - 2 * room)
    x = part.left(z) + room + aside * (0.5 * part.width_m - part.left(z) - 2 * room)
    wobble = rng.normal(0.0, 0.003, (2, points))
    free = part.edge_distance(x + wobble[0], z + wobble[1]) > 0.013
    x, z = np.where(free, x + wobble[0], x), np.where(free, z + wobble[1], z)
    return x, z, np.array([f'{name} {n + 1}' for n in number])
