"""A world of measured sprays: footprints, remainders and noise are resampled from real tables.

The pattern is a flat fan, a sprinkler's track or a magnetron's ring, stretched, skewed or mixed.
What one spray differs from the next by, how panels differ in level and how a gauge scatters are
drawn from measured repeats. ``semi_real_laws`` has the laws, this file draws and paints.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from .measured import measured
from .record import Judged, Painted, Part, amounts, grid_mesh, strengths, trigger
from .semi_real_laws import GRID, HALF_M, Hidden, Job, Pattern, Sheet, gauge_um, remainder_um

STEP_M, POSE_M = 0.010, 0.024
UNSEEN = 60  # points a part
REMAINDERS = 60  # draws that stand for a remainder's covariance
CLEAR_M = 0.015  # between gauge and free edges
ZERO_UM = 0.5
BEGUN_NS = 1_700_000_000_000_000_000

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
    weights, table = rng.dirichlet(np.full(len(pieces), 2.0)), 0
    for weight, piece in zip(weights, pieces, strict=True):
        one = piece(rng, u, v)
        table = table + weight * (one / one.sum())
    table = table / (table.sum() * (lines[1] - lines[0]) ** 2)
    along = table.sum(axis=0) * (lines[1] - lines[0])
    return Pattern(table, rng.uniform(0.9, 2.0), half_width_m, float(1.0 / along.max()))


def _fan(rng, u, v) -> np.ndarray:
    fans = measured().fans
    offset, film = fans[rng.integers(len(fans))]
    turn = rng.choice([0.0, 0.5 * np.pi]) + rng.uniform(-0.1, 0.1)
    u, v = u * np.cos(turn) + v * np.sin(turn), v * np.cos(turn) - u * np.sin(turn)
    thick = rng.uniform(0.25, 0.6)
    return np.interp(u, offset, film, 0.0, 0.0) * np.exp(-0.5 * (v / thick) ** 2)


def _track(rng, u, v) -> np.ndarray:
    return np.interp(np.hypot(u, v) * rng.choice([-1.0, 1.0]), *measured().track, 0.0, 0.0)


def _ring(rng, u, v) -> np.ndarray:
    radius, film = measured().ring
    reach = np.hypot(u, v)
    tail = film[-1] * np.exp(-(reach - radius[-1]) * 2.0)
    return np.where(reach < radius[-1], np.interp(reach, radius, film), tail)


def draw_sheet(rng: np.random.Generator, curved: bool) -> Sheet:
    width, height = rng.uniform(0.5, 0.9), rng.uniform(0.45, 0.8)
    if not curved:
        return Sheet(width, height)
    waves = (rng.uniform(0.1, 0.6), height * rng.uniform(0.55, 0.75), rng.uniform(0.1, 0.3),
             rng.uniform(0.02, 0.06), height * rng.uniform(0.2, 0.4), rng.uniform(0.05, 0.2),
             rng.uniform(0.05, 0.12))  # fmt: skip
    return Sheet(width, height, waves)


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
    tcps, turns, numbers = [], [], []
    for k, line in enumerate(lines):
        tcp, turn = _pass(sheet, way[:: 1 if k % 2 == 0 else -1], line, upright, follow, roll,
                          standoff_m)  # fmt: skip
        if k:
            tcps.append(tcps[-1][-1] * (1 - link) + tcp[0] * link)
            turns.append(np.repeat(turns[-1][-1:], len(link), axis=0))
            numbers.append(np.full(len(link), -1))
        tcps.append(tcp)
        turns.append(turn)
        numbers.append(np.full(len(way), k))
    tcp, turn, number = (np.concatenate(each) for each in (tcps, turns, numbers))
    gaps = np.linalg.norm(np.diff(tcp, axis=0), axis=1) / speed
    time = np.concatenate([[0.0], np.cumsum(gaps)])
    opens = []
    for k in range(count):
        inside = np.abs(way if k % 2 == 0 else way[::-1]) < 0.5 * along + margin
        opens.append(time[np.flatnonzero(number == k)[inside]][[0, -1]])
    middle = 0.5 * (time[1:] + time[:-1])
    step = (number[1:] == number[:-1]) & (number[1:] >= 0)
    place = np.tile(0.5 * (way[1:] + way[:-1]), count)
    # A slow gun, too, sends five times a second.
    every = min(round(POSE_M / STEP_M), max(int(0.2 * speed / STEP_M), 1))
    kept = np.unique(np.append(np.arange(0, len(time), every), len(time) - 1))
    return Job(
        middle[step], gaps[step], 0.5 * (tcp[1:] + tcp[:-1])[step], turn[:-1][step],
        np.array(opens), number[:-1][step], 0.5 * along + run - np.abs(place), lines, upright,
        speed, (time[kept], tcp[kept], turn[kept]),
    )  # fmt: skip


def _pass(
    sheet: Sheet, way: np.ndarray, line: float, upright: bool, follow: float, roll: float,
    standoff_m: float,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """TCP (n, 3) and tool frames (n, 3, 3) along one pass."""
    x, z = (line + 0.0 * way, way + 0.5 * sheet.height_m)
    if not upright:
        x, z = way, 0.5 * sheet.height_m - line + 0.0 * way
    inside_x = np.clip(x, -0.5 * sheet.width_m, 0.5 * sheet.width_m)
    inside_z = np.clip(z, 0.0, sheet.height_m)
    normal = np.mean([sheet.normal(inside_x, np.clip(inside_z + d, 0.0, sheet.height_m))
                      for d in (-0.05, 0.0, 0.05)], axis=0)  # fmt: skip
    axis = -(follow * normal + (1.0 - follow) * np.array([0.0, 1.0, 0.0]))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    level = np.array([np.cos(roll), 0.0, np.sin(roll)])
    tool_x = level - (axis @ level)[:, None] * axis
    tool_x /= np.linalg.norm(tool_x, axis=1, keepdims=True)
    aim = np.stack([x, sheet.y(inside_x, inside_z), z], axis=1)
    return aim - standoff_m * axis, np.stack([tool_x, np.cross(axis, tool_x), axis], axis=-1)


def draw_hidden(rng: np.random.Generator, name: str) -> dict[str, float | np.ndarray]:
    """Sizes of a hidden effect as nature has them."""

    def size(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    sign, angle = rng.choice([-1.0, 1.0]), rng.uniform(-np.pi, np.pi)
    side = np.array([np.cos(angle), np.sin(angle), 0.0])
    draught = np.array([0.0, 0.0, -1.0] if rng.random() < 0.7 else [sign, 0.0, 0.0])
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
    }[name]()  # fmt: skip


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
    gauge = measured().gauge_um * rng.uniform(0.8, 2.0)
    parts, judged = zip(*(
        _read(rng, f'part_{k + 1}', sheet, job, pattern, hidden, readings, noise_from, gauge)
        for k, (sheet, job) in enumerate(zip(sheets, jobs, strict=True))
    ), strict=True)  # fmt: skip
    together, *each = strengths(judged)
    facts = {'shape': shape, 'noise_from': noise_from, 'sizes': {
        name: {k: np.round(v, 4).tolist() for k, v in sizes.items() if np.size(v) < 4}
        for name, sizes in hidden.items()}}  # fmt: skip
    return Painted('semi_real', seed, kind, names, parts, together, tuple(each), amounts(hidden),
                   float(measured().levels.std()), ZERO_UM, facts)  # fmt: skip


def _draw_names(rng: np.random.Generator, kind: str) -> tuple[str, ...]:
    if kind == 'clean':
        return ()
    if kind in ('unknown', 'footprint'):
        return (f'{kind}:{rng.choice(UNKNOWN if kind == "unknown" else FOOTPRINTS)}',)
    one = str(rng.choice(sorted(EFFECTS)))
    if kind == 'effect':
        return (one,)
    return one, str(rng.choice([n for n in sorted(EFFECTS) if EFFECTS[n] != EFFECTS[one]]))


def _read(
    rng, name: str, sheet: Sheet, job: Job, pattern: Pattern, hidden: Hidden, readings: int,
    noise_from: str, gauge: np.ndarray,
) -> tuple[Part, Judged]:  # fmt: skip
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
    free = []
    for k, step in enumerate(1e-2 * Pattern.SPREAD):
        bent = replace(pattern, bend=np.where(np.arange(8) == k, step, 0.0))
        free.append((gauge_um(sheet, job, bent, {}, x, z) - clean[:count]) * 100.0)
    marks = [gauge_um(sheet, job, pattern, {n: s}, x, z) - clean[:count]
             for n, s in hidden.items()]  # fmt: skip
    own = np.column_stack([measured().levels.std() * true[:count], np.full(count, ZERO_UM),
                           others[:count]])  # fmt: skip
    judged = Judged(np.stack([(true - clean)[:count], *marks], 1), np.stack(free, 1), own,
                    np.full(count, sigma / np.sqrt(times)))  # fmt: skip
    across = np.linspace(-0.5, 0.5, int(sheet.width_m / 0.015)) * sheet.width_m
    up = np.linspace(0.0, sheet.height_m, int(sheet.height_m / 0.015))
    stamps, tcp, turn = job.poses
    at = sheet.point(x_all, z_all)
    part = Part(
        name, *grid_mesh(sheet.y(*np.meshgrid(across, up)), across, up),
        BEGUN_NS + np.rint(stamps * 1e9).astype(np.int64), tcp,
        Rotation.from_matrix(turn).as_quat(), *trigger(BEGUN_NS, job.open_s),
        np.tile(at[:count], (times, 1)), np.tile([f'P{k + 1:03d}' for k in range(count)], times),
        np.maximum(reading, 0.0),
        np.full(len(reading), sigma) if noise_from == 'stated' else None,
        at[count:], true[count:] * level + zero,
        np.hypot(sigma, np.linalg.norm(others[count:], axis=1)),
    )  # fmt: skip
    return part, judged


def _places(rng: np.random.Generator, sheet: Sheet, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points in columns, in rows, or anywhere."""
    style = rng.choice(['columns', 'rows', 'anywhere'])
    across, up = rng.random((2, count))
    lines = int(rng.integers(3, 7))
    ladder = np.arange(count) // lines / max((count - 1) // lines, 1)
    line = (np.arange(count) % lines) / (lines - 1)
    if style != 'anywhere':
        across, up = (line, ladder) if style == 'columns' else (ladder, line)
    room = 2 * CLEAR_M
    return (across - 0.5) * (sheet.width_m - room), CLEAR_M + up * (sheet.height_m - room)
