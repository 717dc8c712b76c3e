"""A world of measured sprays: footprints, remainders and noise are resampled from real tables.

The pattern is a flat fan, a sprinkler's track or a magnetron's ring, stretched, skewed or mixed.
What one spray differs from the next by, how panels differ in level and how a gauge scatters are
drawn from measured repeats. Hidden effects follow laws of this file alone. The tables are read
beside the repository, see ``available``.
"""

from __future__ import annotations

import csv
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.spatial.transform import Rotation

from .record import Painted, Part, detectability, grid_mesh

DATA = Path(__file__).resolve().parents[3] / 'shared' / 'data'
# What a user's model is told: emission point behind the TCP, model plane before that.
EMISSION_M, PLANE_M = 0.05, 0.30
GRID, HALF_M = 181, 0.45  # of a footprint's table
STEP_M, POSE_M = 0.010, 0.024
UNSEEN = 60  # points a part
REMAINDERS = 60  # draws that stand for a remainder's covariance
KAPPA_PER_M = 4.0
CLEAR_M = 0.015  # between gauge and free edges
ZERO_UM = 0.5
DOWN = np.array([0.0, 0.0, -1.0])

LATERAL, STANDOFF, CURVED, EDGE, ORDER, LEVEL, OTHER = range(7)
EFFECTS = {  # family of each effect that this world can hide
    'tcp_offset': LATERAL, 'tcp_tilt': LATERAL, 'part_misalignment': LATERAL,
    'air_drift': LATERAL, 'sag': LATERAL, 'tcp_standoff': STANDOFF, 'pattern_spread': STANDOFF,
    'standoff_efficiency': STANDOFF, 'incidence_attraction': OTHER, 'gun_wake': EDGE,
    'corner_slowdown': EDGE, 'trigger_lag': EDGE, 'edge_build': EDGE, 'flow_drift': ORDER,
    'fog_gradient': ORDER, 'convex_attraction': CURVED, 'faraday_shielding': CURVED,
    'gauge_curvature_bias': CURVED, 'overspray_fog': LEVEL, 'gauge_zero': LEVEL,
}  # fmt: skip
UNKNOWN = ('blotches', 'stripe', 'pulsing', 'clogging')
FOOTPRINTS = ('fan', 'track', 'mixed', 'skewed')


def available() -> bool:
    """Whether the measured tables are there."""
    return (DATA / 'patternator_two_nozzles.csv').is_file()


# --- what was measured


@dataclass(frozen=True)
class Measured:
    """Shapes and repeats; offsets in half widths at half height, films in their peak."""

    fans: tuple[tuple[np.ndarray, np.ndarray], ...]
    track: tuple[np.ndarray, np.ndarray]
    ring: tuple[np.ndarray, np.ndarray]
    remainders: tuple[tuple[np.ndarray, np.ndarray], ...]
    levels: np.ndarray
    gauge_um: np.ndarray


@cache
def measured() -> Measured:
    sprays = defaultdict(lambda: defaultdict(list))
    for row in _rows('patternator_two_nozzles.csv'):
        spray = row['nozzle'], row['boom_height_in']
        sprays[spray][row['repetition']].append(float(row['collected_ml']))
    fans, remainders = [], []
    for repetitions in sprays.values():
        films = np.array(list(repetitions.values()))
        mean, count = films.mean(axis=0), len(films)
        offset = np.arange(len(mean)) - np.average(np.arange(len(mean)), weights=mean)
        offset /= 0.5 * np.count_nonzero(mean > 0.5 * mean.max())
        fans.append((offset, mean / mean.max()))
        level = films @ mean / (mean @ mean)
        rest = (films - level[:, None] * mean) * np.sqrt(count / (count - 1.0)) / mean.max()
        remainders += [(offset, one) for one in rest]
    track = np.array([[float(v) for v in row.values()] for row in _rows(
        'travelling_gun_transect_1d_collapse.csv')])  # fmt: skip
    ring = np.array([[float(v) for v in row.values()][1:] for row in _rows(
        'magnetron_static_radial_130mm.csv')])  # fmt: skip
    panels = np.array([float(row['thickness_um']) for row in _rows('clearcoat_40_panels_um.csv')])
    varnish = np.array([float(row['thickness']) for row in _rows(
        'varnish_dft_operator_gate_day_mils.csv')]).reshape(-1, 2)  # fmt: skip
    return Measured(
        tuple(fans),
        (track[:, 0] / 90.0, track[:, 1] / track[:, 1].max()),
        (ring[:, 0] / 115.0, ring[:, 1] / ring[:, 1].max()),
        tuple(remainders),
        panels / panels.mean() - 1.0,
        25.4 * (varnish[:, 0] - varnish[:, 1]) / np.sqrt(2.0),
    )


def _rows(name: str) -> list[dict]:
    with (DATA / name).open(newline='') as file:
        return list(csv.DictReader(file))


# --- the pattern


@dataclass(frozen=True)
class Pattern:
    """A footprint on the model plane as a table, and how it may be bent."""

    table: np.ndarray  # (GRID, GRID) share of the paint a square metre
    volume_cm3_per_s: float
    half_width_m: float
    track_m: float  # paint of a pass over its peak: the width of a box
    bend: np.ndarray = field(default_factory=lambda: np.zeros(8))

    # Standard deviations of what a judge takes as unknown of a pattern.
    SPREAD = np.array([0.5, 0.2, 0.2, 0.15, 0.15, 0.15, 0.15, 0.2])

    def flux(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """um/s on the model plane at tool coordinates [m], any shape."""
        level, wide, aspect, skew_u, skew_v, round_, turn, ring = self.bend
        if self.bend.any():
            u, v = u + turn * v, v - turn * u
            reach = (u**2 + v**2) / self.half_width_m**2
            scale = np.exp(-wide) * (1.0 + round_ * np.tanh(reach - 1.0) / 4.0)
            u, v = u * scale * np.exp(-0.5 * aspect), v * scale * np.exp(0.5 * aspect)
        cell = 0.5 * (GRID - 1) / HALF_M
        places = np.stack([(v + HALF_M).ravel() * cell, (u + HALF_M).ravel() * cell])
        density = map_coordinates(self.table, places, order=1).reshape(np.shape(u))
        if self.bend.any():
            lean = 1.0 + skew_u * np.tanh(u / self.half_width_m)
            lean = lean + skew_v * np.tanh(v / self.half_width_m)
            lean = lean + ring * (np.exp(-0.5 * reach) - 0.4)
            density = density * np.exp(level) * np.maximum(lean, 0.0)
        return self.volume_cm3_per_s * density


def draw_pattern(rng: np.random.Generator, shape: str, half_width_m: float) -> Pattern:
    """A measured shape: 'ring' (which two Gaussians describe), or one of FOOTPRINTS."""
    lines = np.linspace(-HALF_M, HALF_M, GRID)
    u, v = np.meshgrid(lines / half_width_m, lines / half_width_m)
    stretch = np.exp(rng.uniform(-0.05, 0.05) if shape == 'ring' else rng.uniform(-0.3, 0.3))
    u, v = u * stretch, v / stretch
    if shape == 'skewed':
        u = u + rng.uniform(0.12, 0.3) * (v**2 - 0.4) * np.exp(-0.2 * v**2)
    pieces = {'ring': [_ring], 'fan': [_fan], 'track': [_track], 'skewed': [_ring, _fan],
              'mixed': [_ring, _fan, _track]}[shape]  # fmt: skip
    weights = rng.dirichlet(np.full(len(pieces), 2.0))
    table = sum(w * piece(rng, u, v) for w, piece in zip(weights, pieces, strict=True))
    cell_m2 = (lines[1] - lines[0]) ** 2
    table = table / (table.sum() * cell_m2)
    along = table.sum(axis=0) * (lines[1] - lines[0])
    volume = rng.uniform(0.9, 2.0)
    return Pattern(table, volume, half_width_m, float(1.0 / along.max()))


def _fan(rng, u, v) -> np.ndarray:
    fans = measured().fans
    offset, film = fans[rng.integers(len(fans))]
    turn = rng.choice([0.0, 0.5 * np.pi]) + rng.uniform(-0.1, 0.1)
    u, v = u * np.cos(turn) + v * np.sin(turn), v * np.cos(turn) - u * np.sin(turn)
    thick = rng.uniform(0.25, 0.6)
    one = np.interp(u, offset, film, 0.0, 0.0) * np.exp(-0.5 * (v / thick) ** 2)
    return one / one.sum()


def _track(rng, u, v) -> np.ndarray:
    offset, film = measured().track
    one = np.interp(np.hypot(u, v) * rng.choice([-1.0, 1.0]), offset, film, 0.0, 0.0)
    return one / one.sum()


def _ring(rng, u, v) -> np.ndarray:
    radius, film = measured().ring
    reach = np.hypot(u, v)
    tail = film[-1] * np.exp(-(reach - radius[-1]) * 2.0)
    one = np.where(reach < radius[-1], np.interp(reach, radius, film), tail)
    return one / one.sum()


# --- parts and jobs


@dataclass(frozen=True)
class Sheet:
    """A part y = f(x, z), the gun on the side of +y."""

    width_m: float
    height_m: float
    waves: tuple[float, ...] = ()  # none: flat

    def y(self, x: np.ndarray, z: np.ndarray) -> np.ndarray:
        if not self.waves:
            return 0.0 * (x + z)
        crown, ridge_at, ridge, ridge_soft, hollow_at, hollow, hollow_soft = self.waves
        return (
            -0.5 * crown * x**2
            - ridge * np.hypot(z - ridge_at, ridge_soft)
            + hollow * np.arctan((z - hollow_at) / hollow_soft) * (z - hollow_at)
        )

    def point(self, x, z) -> np.ndarray:
        return np.stack([x, self.y(x, z), z], axis=-1)

    def normal(self, x, z, h: float = 1e-4) -> np.ndarray:
        y_x = (self.y(x + h, z) - self.y(x - h, z)) / (2 * h)
        y_z = (self.y(x, z + h) - self.y(x, z - h)) / (2 * h)
        normal = np.stack([-y_x, np.ones_like(y_x), -y_z], axis=-1)
        return normal / np.linalg.norm(normal, axis=-1, keepdims=True)

    def bent_per_m(self, x, z, h: float = 0.012) -> np.ndarray:
        """Sum of the curvatures over a probe's reach, positive where hollow to the gun."""
        around = self.y(x + h, z) + self.y(x - h, z) + self.y(x, z + h) + self.y(x, z - h)
        return (around - 4 * self.y(x, z)) / h**2

    def to_edge_m(self, x, z) -> np.ndarray:
        sides = (0.5 * self.width_m - np.abs(x), z, self.height_m - z)
        return np.minimum.reduce(np.broadcast_arrays(*sides))


def draw_sheet(rng: np.random.Generator, curved: bool) -> Sheet:
    width, height = rng.uniform(0.5, 0.9), rng.uniform(0.45, 0.8)
    if not curved:
        return Sheet(width, height)
    waves = (rng.uniform(0.1, 0.6), height * rng.uniform(0.55, 0.75), rng.uniform(0.1, 0.3),
             rng.uniform(0.02, 0.06), height * rng.uniform(0.2, 0.4), rng.uniform(0.05, 0.2),
             rng.uniform(0.05, 0.12))  # fmt: skip
    return Sheet(width, height, waves)


@dataclass(frozen=True)
class Job:
    """Sub-steps of a gun's way: s of them while it may spray, and its log."""

    time_s: np.ndarray  # (s,)
    dwell_s: np.ndarray
    tcp_m: np.ndarray  # (s, 3)
    turn: np.ndarray  # (s, 3, 3), columns are the tool's axes
    open_s: np.ndarray  # (passes, 2) of the trigger
    number: np.ndarray  # (s,) pass
    to_turn_m: np.ndarray  # (s,) way to the nearest end of the pass
    lines_m: np.ndarray  # (passes,) place of each pass across
    upright: bool  # passes run up and down
    speed_m_per_s: float
    poses: tuple[np.ndarray, np.ndarray, np.ndarray]  # stamps [s], TCP, turn

    @property
    def velocity_m_per_s(self) -> np.ndarray:
        way = np.where(self.number % 2 == 0, 1.0, -1.0) * self.speed_m_per_s
        return way[:, None] * (np.array([0.0, 0.0, 1.0]) if self.upright else [1.0, 0.0, 0.0])

    def opened(self, time_s: np.ndarray) -> np.ndarray:
        """Flow of an ideal valve: 1 while the trigger is held."""
        inside = (time_s[:, None] >= self.open_s[:, 0]) & (time_s[:, None] < self.open_s[:, 1])
        return inside.any(axis=1).astype(float)


def draw_job(
    rng: np.random.Generator, sheet: Sheet, pattern: Pattern, film_um: float, roll: float,
    standoff_m: float, near: bool,
) -> Job:  # fmt: skip
    """Parallel passes to and fro; `near`: the gun opens and closes by the part's edges."""
    upright = bool(rng.random() < 0.3)
    along, across = (sheet.height_m, sheet.width_m)[:: 1 if upright else -1]
    index = pattern.track_m * rng.uniform(0.45, 0.75)
    count = 1 if rng.random() < 0.2 else int(np.clip(np.ceil(across / index) + 1, 2, 6))
    lines = (np.arange(count) - 0.5 * (count - 1)) * index
    margin = rng.uniform(-0.02, 0.06) if near else 1.3 * pattern.half_width_m
    run = margin + rng.uniform(0.03, 0.10)
    speed = pattern.volume_cm3_per_s / (film_um * (index if count > 1 else pattern.track_m))
    follow = rng.uniform(0.0, 0.9)
    way = np.arange(-0.5 * along - run, 0.5 * along + run, STEP_M)
    link = np.linspace(0.0, 1.0, int(index / STEP_M) + 2)[1:-1, None]
    tcps, turns, numbers, gaps = [], [], [], []
    for k, line in enumerate(lines):
        here = way if k % 2 == 0 else way[::-1]
        x, z = (line + 0.0 * here, here + 0.5 * sheet.height_m)
        if not upright:
            x, z = here, 0.5 * sheet.height_m - line + 0.0 * here
        inside_x = np.clip(x, -0.5 * sheet.width_m, 0.5 * sheet.width_m)
        inside_z = np.clip(z, 0.0, sheet.height_m)
        normal = np.mean([sheet.normal(inside_x, np.clip(inside_z + d, 0.0, sheet.height_m))
                          for d in (-0.05, 0.0, 0.05)], axis=0)  # fmt: skip
        axis = -(follow * normal + (1.0 - follow) * np.array([0.0, 1.0, 0.0]))
        axis /= np.linalg.norm(axis, axis=1, keepdims=True)
        aim = np.stack([x, sheet.y(inside_x, inside_z), z], axis=1)
        tcp = aim - standoff_m * axis
        if k:
            tcps.append(tcps[-1][-1] * (1 - link) + tcp[0] * link)
            turns.append(np.repeat(turns[-1][-1:], len(link), axis=0))
            numbers.append(np.full(len(link), -1))
        tcps.append(tcp)
        turns.append(_tool(axis, roll))
        numbers.append(np.full(len(way), k))
    tcp, turn, number = (np.concatenate(each) for each in (tcps, turns, numbers))
    gaps = np.linalg.norm(np.diff(tcp, axis=0), axis=1) / speed
    time = np.concatenate([[0.0], np.cumsum(gaps)])
    opens = []
    for k in range(count):
        of_pass = np.flatnonzero(number == k)
        inside = of_pass[np.abs(way if k % 2 == 0 else way[::-1]) < 0.5 * along + margin]
        opens.append((time[inside[0]], time[inside[-1]]))
    middle = 0.5 * (time[1:] + time[:-1])
    step = (number[1:] == number[:-1]) & (number[1:] >= 0)
    place = np.tile(0.5 * (way[1:] + way[:-1]), count)
    kept = np.unique(np.append(np.arange(0, len(time), round(POSE_M / STEP_M)), len(time) - 1))
    return Job(
        middle[step], gaps[step], 0.5 * (tcp[1:] + tcp[:-1])[step], turn[:-1][step],
        np.array(opens), number[:-1][step], 0.5 * along + run - np.abs(place), lines, upright,
        speed, (time[kept], tcp[kept], turn[kept]),
    )  # fmt: skip


def _tool(axis: np.ndarray, roll: float) -> np.ndarray:
    """(n, 3, 3) tool frames that look along axis (n, 3), rolled about it."""
    level = np.array([np.cos(roll), 0.0, np.sin(roll)])
    x = level - (axis @ level)[:, None] * axis
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(axis, x), axis], axis=-1)


# --- what is hidden, and the film


def draw_hidden(rng: np.random.Generator, name: str) -> dict[str, float | np.ndarray]:
    """Sizes of a hidden effect as nature has them."""

    def size(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    sign, angle = rng.choice([-1.0, 1.0]), rng.uniform(-np.pi, np.pi)
    side = np.array([np.cos(angle), np.sin(angle), 0.0])
    draught = DOWN if rng.random() < 0.7 else np.array([sign, 0.0, 0.0])
    return {
        'tcp_offset': lambda: {'m': size(0.004, 0.03) * side},
        'tcp_tilt': lambda: {'rad': np.radians(size(1.5, 10.0)) * side},
        'part_misalignment': lambda: {'m': size(0.004, 0.03) * side[[0, 2, 1]],
                                      'yaw_rad': sign * np.radians(size(0.2, 1.0))},
        'air_drift': lambda: {'m': size(0.008, 0.07) * draught},
        'sag': lambda: {'run_m': size(0.002, 0.012)},
        'tcp_standoff': lambda: {'m': sign * size(0.006, 0.045)},
        'pattern_spread': lambda: {'share': size(0.15, 0.55)},
        'standoff_efficiency': lambda: {'fade_m': size(0.1, 0.8)},
        'incidence_attraction': lambda: {'gain': size(0.5, 4.0) if rng.random() < 0.75 else -0.6},
        'gun_wake': lambda: {'s': size(0.02, 0.12)},
        'corner_slowdown': lambda: {'gain': size(0.2, 2.0), 'reach_m': rng.uniform(0.12, 0.3)},
        'trigger_lag': lambda: {'s': size(0.05, 0.5)},
        'edge_build': lambda: {'gain': size(0.1, 1.2), 'reach_m': rng.uniform(0.01, 0.03)},
        'flow_drift': lambda: {'whole': sign * size(0.06, 0.6)},
        'fog_gradient': lambda: {'um': size(1.0, 12.0)},
        'convex_attraction': lambda: {'gain': size(0.08, 0.7)},
        'faraday_shielding': lambda: {'gain': size(0.1, 0.8)},
        'gauge_curvature_bias': lambda: {'um': size(0.8, 8.0)},
        'overspray_fog': lambda: {'um': size(0.8, 8.0)},
        'gauge_zero': lambda: {'um': sign * size(1.0, 6.0)},
        'unknown:blotches': lambda: {'sd': size(0.04, 0.3), 'waves': rng.normal(size=(24, 2)),
                                     'phase': rng.uniform(0, 2 * np.pi, 24)},
        'unknown:stripe': lambda: {'loss': size(0.1, 0.9), 'at': rng.uniform(0.25, 0.75),
                                   'wide_m': rng.uniform(0.05, 0.12)},
        'unknown:pulsing': lambda: {'gain': size(0.1, 0.8), 'way_m': rng.uniform(0.4, 0.9)},
        'unknown:clogging': lambda: {'loss': size(0.15, 0.9)},
    }.get(name, dict)()  # fmt: skip


Hidden = dict[str, dict]


def gauge_um(
    sheet: Sheet, job: Job, pattern: Pattern, hidden: Hidden, x: np.ndarray, z: np.ndarray
) -> np.ndarray:
    """What a gauge without noise says at points (n,) of the part."""
    film = film_um(sheet, job, pattern, hidden, x, z)
    if sag := hidden.get('sag'):
        # Paint above a yield film runs down: what flows in at the top less what leaves below.
        near = [film_um(sheet, job, pattern, hidden, x, z + d) for d in (-0.004, 0.004)]
        mean = film.mean()
        flow = [sag['run_m'] * np.maximum(each - 0.3 * mean, 0.0) ** 3 / mean**2 for each in near]
        film = film + (flow[1] - flow[0]) / 0.008
    bent = sheet.bent_per_m(x, z) / KAPPA_PER_M
    if edge := hidden.get('edge_build'):
        film = film * (1 + edge['gain'] / (1 + (sheet.to_edge_m(x, z) / edge['reach_m']) ** 2))
    if ridge := hidden.get('convex_attraction'):
        film = film * (1 + ridge['gain'] * np.tanh(np.maximum(-bent, 0.0)))
    if hollow := hidden.get('faraday_shielding'):
        film = film * (1 - hollow['gain'] * (1 - np.exp(-np.maximum(bent, 0.0))))
    if blotch := hidden.get('unknown:blotches'):
        waves = np.cos(np.stack([x, z], 1) @ blotch['waves'].T / 0.09 + blotch['phase'])
        film = film * np.maximum(1 + blotch['sd'] * np.sqrt(2 / 24) * waves.sum(axis=1), 0.0)
    if tape := hidden.get('unknown:stripe'):
        off = np.abs(x - (tape['at'] - 0.5) * sheet.width_m) - 0.5 * tape['wide_m']
        film = film * (1 - tape['loss'] * 0.5 * (1 - np.tanh(off / 0.008)))
    if fog := hidden.get('fog_gradient'):
        film = film + fog['um'] * (1 - z / sheet.height_m) ** 2
    for level in ('overspray_fog', 'gauge_zero'):
        film = film + hidden.get(level, {'um': 0.0})['um']
    return film - hidden.get('gauge_curvature_bias', {'um': 0.0})['um'] * bent


def film_um(
    sheet: Sheet, job: Job, pattern: Pattern, hidden: Hidden, x: np.ndarray, z: np.ndarray
) -> np.ndarray:
    """Film that lands, by straight rays in solid angles, each hidden law put in where it acts."""
    at, normal = sheet.point(x, z), sheet.normal(x, z)
    tcp, turn = _true_poses(job, hidden)
    mouth = tcp - EMISSION_M * turn[:, :, 2]
    ray = at[:, None] - mouth
    if drift := hidden.get('air_drift'):
        depth = np.einsum('psi,si->ps', ray, turn[:, :, 2])
        ray = ray - (np.maximum(depth, 0.0) / PLANE_M)[:, :, None] ** 1.4 * drift['m']
    seen = np.einsum('psi,sij->psj', ray, turn)
    depth = np.maximum(seen[:, :, 2], 1e-3)
    length2 = np.einsum('psi,psi->ps', ray, ray)
    facing = -np.einsum('psi,pi->ps', ray, normal) / np.sqrt(length2)
    u, v = PLANE_M * seen[:, :, 0] / depth, PLANE_M * seen[:, :, 1] / depth
    # Intensity in the solid angle times what the surface catches of it.
    caught = PLANE_M**2 * np.sqrt(length2) / depth**3 * np.maximum(facing, 0.0)
    if spread := hidden.get('pattern_spread'):
        far = depth / PLANE_M
        wider = (spread['share'] + (1 - spread['share']) * far) / far
        u, v, caught = u / wider, v / wider, caught / wider**2
    if loss := hidden.get('standoff_efficiency'):
        caught = caught * np.exp(-(depth - PLANE_M) / loss['fade_m'])
    if pull := hidden.get('incidence_attraction'):
        caught = caught * (1 + pull['gain'] * (1 - facing**2))
    flux = pattern.flux(u, v) * caught * (seen[:, :, 2] > 0)
    if clog := hidden.get('unknown:clogging'):
        late = job.time_s / job.time_s[-1]
        flux = flux * (1 - clog['loss'] * late * (1 + np.tanh(u / 0.03)) / 2)
    return flux @ (job.dwell_s * _flow(job, hidden))


def _true_poses(job: Job, hidden: Hidden) -> tuple[np.ndarray, np.ndarray]:
    tcp, turn = job.tcp_m, job.turn
    if offset := hidden.get('tcp_offset'):
        tcp = tcp + turn @ offset['m']
    if nearer := hidden.get('tcp_standoff'):
        tcp = tcp + nearer['m'] * turn[:, :, 2]
    if tilt := hidden.get('tcp_tilt'):
        turn = turn @ Rotation.from_rotvec(tilt['rad']).as_matrix()
    if hung := hidden.get('part_misalignment'):
        back = Rotation.from_rotvec([0.0, hung['yaw_rad'], 0.0]).as_matrix()
        middle = np.array([0.0, 0.0, 0.3])
        tcp, turn = (tcp - middle) @ back.T + middle - hung['m'], back @ turn
    if wake := hidden.get('gun_wake'):
        tcp = tcp - wake['s'] * job.velocity_m_per_s
    return tcp, turn


def _flow(job: Job, hidden: Hidden) -> np.ndarray:
    time = job.time_s
    # A sub-step at a trigger's edge counts for its share.
    shares = (np.arange(8) + 0.5) / 8 - 0.5
    fine = (time[:, None] + shares * job.dwell_s[:, None]).ravel()
    lag = hidden.get('trigger_lag', {'s': 0.0})['s']
    delays = (np.arange(12) + 0.5) / 12 * lag if lag else np.zeros(1)
    flow = np.mean([job.opened(fine - d) for d in delays], axis=0).reshape(len(time), -1).mean(1)
    if drift := hidden.get('flow_drift'):
        middle, length = 0.5 * time[-1], 0.2 * time[-1]
        flow = flow * (1 + drift['whole'] * (1 / (1 + np.exp(-(time - middle) / length)) - 0.5))
    if slow := hidden.get('corner_slowdown'):
        share = np.clip(job.to_turn_m / slow['reach_m'], 0.0, 1.0)
        flow = flow * (1 + slow['gain'] * np.cos(0.5 * np.pi * share) ** 2)
    if pulse := hidden.get('unknown:pulsing'):
        way = job.speed_m_per_s * time
        flow = flow * (1 + pulse['gain'] * np.sin(2 * np.pi * way / pulse['way_m']))
    return flow


def remainder_um(
    rng: np.random.Generator, sheet: Sheet, job: Job, pattern: Pattern, x, z
) -> np.ndarray:
    """What a part differs from any law by: measured differences between sprays of one nozzle.

    Each pass carries the same difference over the offset from its line, which turns slowly into
    another one along the way.
    """
    curves = measured().remainders
    chosen = [curves[k] for k in rng.integers(len(curves), size=2)]
    signs = rng.choice([-1.0, 1.0], 2)
    along, across = (z, x) if job.upright else (x, 0.5 * sheet.height_m - z)
    angle = along / rng.uniform(0.2, 0.6) + rng.uniform(0, 2 * np.pi)
    peak = pattern.volume_cm3_per_s / (job.speed_m_per_s * pattern.track_m)
    total = 0.0
    for line in job.lines_m:
        offset = (across - line) / pattern.half_width_m
        one, other = (np.interp(offset, *curve, 0.0, 0.0) for curve in chosen)
        total = total + signs[0] * one * np.cos(angle) + signs[1] * other * np.sin(angle)
    return peak * total


# --- a campaign


def paint(
    seed: int, kind: str, effects: tuple[str, ...] | None = None, pattern: Pattern | None = None
) -> Painted:
    """The campaign of a seed; `effects` and `pattern` are taken instead of a draw.

    Raises:
        FileNotFoundError: the measured tables are not there.
    """
    rng = np.random.default_rng([81, seed])
    names = _draw_names(rng, kind) if effects is None else effects
    strange = kind == 'footprint' or (kind != 'clean' and rng.random() < 0.5)
    shape = names[0].partition(':')[2] if kind == 'footprint' else str(rng.choice(FOOTPRINTS))
    shape = shape if strange else 'ring'
    drawn = draw_pattern(rng, shape, rng.uniform(0.10, 0.2))
    pattern = drawn if pattern is None else pattern
    hidden = {name: draw_hidden(rng, name) for name in names if kind != 'footprint'}
    count = int(rng.choice([1, 2, 3, 4], p=[0.2, 0.35, 0.3, 0.15]))
    # An effect that can show nowhere would be no case.
    families = {EFFECTS.get(name) for name in names}
    count = max(count, 2) if families & {STANDOFF, LATERAL} else count
    sheets = [draw_sheet(rng, CURVED in families or rng.random() < 0.6) for _ in range(count)]
    roll, film = rng.uniform(-np.pi, np.pi), rng.uniform(14.0, 30.0)
    apart = [0.15, 0.36, 0.22, 0.29] if STANDOFF in families else rng.uniform(0.2, 0.3, 4)
    standoffs = apart[:count] + rng.normal(0, 0.005, count)
    near = rng.random() < (0.8 if EDGE in families else 0.4)
    jobs = [draw_job(rng, sheet, pattern, film, roll + np.pi * (rng.random() < 0.25), off, near)
            for sheet, off in zip(sheets, standoffs, strict=True)]  # fmt: skip
    readings = int(np.exp(rng.uniform(np.log(50), np.log(300))) / count) + 4
    noise_from = str(rng.choice(['repeats', 'stated', 'nothing'], p=[0.5, 0.4, 0.1]))
    gauge_um = measured().gauge_um * rng.uniform(0.8, 2.0)
    parts, judged = [], []
    for k, (sheet, job) in enumerate(zip(sheets, jobs, strict=True)):
        part, columns = _read(rng, f'part_{k + 1}', sheet, job, pattern, hidden, readings,
                              noise_from, gauge_um)  # fmt: skip
        parts.append(part)
        judged.append(columns)
    strengths = _strengths(judged, len(hidden) + (kind == 'footprint'))
    facts = {'shape': shape, 'noise_from': noise_from, 'sizes': {
        name: {k: np.round(v, 4).tolist() for k, v in sizes.items() if np.size(v) < 4}
        for name, sizes in hidden.items()}}  # fmt: skip
    return Painted('semi_real', seed, kind, names, tuple(parts), strengths[0],
                   tuple(strengths[1:]), _amounts(hidden), float(measured().levels.std()),
                   ZERO_UM, facts)  # fmt: skip


def _draw_names(rng: np.random.Generator, kind: str) -> tuple[str, ...]:
    if kind == 'clean':
        return ()
    if kind in ('unknown', 'footprint'):
        return (f'{kind}:{rng.choice(UNKNOWN if kind == "unknown" else FOOTPRINTS)}',)
    names = sorted(EFFECTS)
    one = str(rng.choice(names))
    if kind == 'effect':
        return (one,)
    others = [n for n in names if EFFECTS[n] != EFFECTS[one]]
    return one, str(rng.choice(others))


def _read(
    rng, name: str, sheet: Sheet, job: Job, pattern: Pattern, hidden: Hidden, readings: int,
    noise_from: str, gauge: np.ndarray,
) -> tuple[Part, dict]:  # fmt: skip
    """The part with its readings, and what the judge needs of them."""
    times = 2 if noise_from == 'repeats' else 1
    x, z = _places(rng, sheet, max(readings // times, 12))
    count = len(x)
    x_all = np.append(x, rng.uniform(-0.5, 0.5, UNSEEN) * (sheet.width_m - 2 * CLEAR_M))
    z_all = np.append(z, CLEAR_M + rng.random(UNSEEN) * (sheet.height_m - 2 * CLEAR_M))
    clean = gauge_um(sheet, job, pattern, {}, x_all, z_all)
    true = gauge_um(sheet, job, pattern, hidden, x_all, z_all)
    level, zero = 1 + rng.choice(measured().levels), ZERO_UM * rng.normal()
    draws = np.stack([remainder_um(rng, sheet, job, pattern, x_all, z_all)
                      for _ in range(REMAINDERS + 1)], axis=1)  # fmt: skip
    rest, others = draws[:, 0], draws[:, 1:] / np.sqrt(REMAINDERS)
    reading = np.concatenate([
        true[:count] * level + zero + rest[:count] + rng.choice(gauge, count)
        for _ in range(times)
    ])  # fmt: skip
    sigma = float(gauge.std())
    labels = np.tile([f'P{k + 1:03d}' for k in range(count)], times)
    at, free = sheet.point(x_all, z_all), []
    for k, step in enumerate(1e-2 * Pattern.SPREAD):
        bend = np.where(np.arange(8) == k, step, 0.0)
        bent = gauge_um(sheet, job, replace(pattern, bend=bend), {}, x[:count], z[:count])
        free.append((bent - clean[:count]) * 100.0)
    marks = [gauge_um(sheet, job, pattern, {n: s}, x, z) - clean[:count]
             for n, s in hidden.items()]  # fmt: skip
    columns = {
        'marks': np.stack([(true - clean)[:count], *marks], 1), 'pattern': np.stack(free, 1),
        'own': np.column_stack([measured().levels.std() * true[:count], np.full(count, ZERO_UM),
                                others[:count]]),
        'sigma': np.full(count, sigma / np.sqrt(times)),
    }  # fmt: skip
    vertices, faces = grid_mesh_of(sheet)
    stamps, tcp, turn = job.poses
    start = 1_700_000_000_000_000_000
    part = Part(
        name, vertices, faces, start + np.rint(stamps * 1e9).astype(np.int64), tcp,
        Rotation.from_matrix(turn).as_quat(),
        start + np.rint(np.append(0.0, job.open_s.ravel()) * 1e9).astype(np.int64),
        np.append(False, np.tile([True, False], len(job.open_s))),
        np.tile(at[:count], (times, 1)), labels, np.maximum(reading, 0.0),
        np.full(len(reading), sigma) if noise_from == 'stated' else None,
        at[count:], true[count:] * level + zero,
        np.hypot(sigma, np.linalg.norm(others[count:], axis=1)),
    )  # fmt: skip
    return part, columns


def _places(rng: np.random.Generator, sheet: Sheet, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points in columns, in rows, or anywhere."""
    style = rng.choice(['columns', 'rows', 'anywhere'])
    across, up = rng.random((2, count))
    lines = int(rng.integers(3, 7))
    ladder = np.arange(count) // lines / max((count - 1) // lines, 1)
    line = (np.arange(count) % lines) / (lines - 1)
    if style == 'columns':
        across, up = line, ladder
    elif style == 'rows':
        across, up = ladder, line
    room = 2 * CLEAR_M
    return (across - 0.5) * (sheet.width_m - room), CLEAR_M + up * (sheet.height_m - room)


def grid_mesh_of(sheet: Sheet, edge_m: float = 0.015) -> tuple[np.ndarray, np.ndarray]:
    x = np.linspace(-0.5, 0.5, int(sheet.width_m / edge_m)) * sheet.width_m
    z = np.linspace(0.0, sheet.height_m, int(sheet.height_m / edge_m))
    return grid_mesh(sheet.y(*np.meshgrid(x, z)), x, z)


def _strengths(judged: list[dict], hidden: int) -> list[float]:
    """Of all that is hidden together, then of each."""
    if not hidden:
        return [0.0]
    rows = [len(each['sigma']) for each in judged]
    ends = np.cumsum(rows)
    own = np.zeros((ends[-1], sum(each['own'].shape[1] for each in judged)))
    column = 0
    for end, count, each in zip(ends, rows, judged, strict=True):
        wide = each['own'].shape[1]
        own[end - count : end, column : column + wide] = each['own']
        column += wide
    marks, pattern, sigma = (
        np.concatenate([each[key] for each in judged]) for key in ('marks', 'pattern', 'sigma')
    )
    return detectability(marks, np.hstack([pattern, own]), sigma).tolist()


def _amounts(hidden: Hidden) -> dict[str, float]:
    """Sizes in the parameters of the library, where both mean the same."""
    meant: dict[str, Callable[[dict], dict]] = {
        'tcp_offset': lambda h: {'offset_x_m': h['m'][0], 'offset_y_m': h['m'][1]},
        'tcp_tilt': lambda h: {'tilt_x_rad': h['rad'][0], 'tilt_y_rad': h['rad'][1]},
        'tcp_standoff': lambda h: {'offset_z_m': h['m']},
        'air_drift': lambda h: {'shift_down_m': -h['m'][2], 'shift_across_m': -h['m'][0]},
        'gun_wake': lambda h: {'lag_s': h['s']},
        'overspray_fog': lambda h: {'fog_um': h['um']},
        'gauge_zero': lambda h: {'offset_um': h['um']},
    }
    return {
        f'{name}.{key}': float(value)
        for name, sizes in hidden.items()
        for key, value in meant.get(name, lambda h: {})(sizes).items()
    }
