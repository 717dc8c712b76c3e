"""A world of drops in an air jet: five sizes, a jet that slows down, a field, and a draught.

``jet_drops`` and ``jet_film`` have its physics; this file draws and paints.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .jet_drops import Bell
from .jet_film import Hidden, Plate, Run, shown_um
from .record import Judged, Painted, Part, amounts, grid_mesh, strengths, trigger

UNSEEN, NEAR_EDGE_M = 60, 0.015
BEGUN_NS = 1_710_000_000_000_000_000

# Families: effects of one are not paired.
FAMILIES = {
    'aside': ('air_drift', 'tcp_offset', 'tcp_tilt', 'part_misalignment', 'sag'),
    'distance': ('pattern_spread', 'standoff_efficiency', 'tcp_standoff'),
    'field': ('incidence_attraction',),
    'relief': ('convex_attraction', 'faraday_shielding', 'gauge_curvature_bias'),
    'ends': ('gun_wake', 'trigger_lag', 'corner_slowdown', 'edge_build', 'pose_lag'),
    'course': ('flow_drift', 'fog_gradient'),
    'floor': ('overspray_fog', 'gauge_zero'),
}
EFFECTS = {name: family for family, names in FAMILIES.items() for name in names}
UNKNOWN = ('eddy', 'wet_patch', 'diagonal', 'surge')
FOOTPRINTS = ('lobes', 'squeezed', 'two_rings', 'off_centre')


def draw_bell(rng: np.random.Generator, shape: str = '') -> Bell:
    """A round bell whose heavy drops fly further out, or one of FOOTPRINTS."""
    ring = rng.uniform(0.06, 0.14)
    fan = 1.0 + rng.uniform(0.1, 0.35) * np.linspace(-1.0, 1.0, 5)
    soft = ring * rng.uniform(0.4, 0.65) * np.linspace(1.15, 0.9, 5)
    bell = Bell(rng.uniform(0.9, 2.2), ring * fan, soft,
                lobes=(rng.uniform(0.0, 0.2), 1, rng.uniform(-np.pi, np.pi)))  # fmt: skip
    angle = rng.uniform(-np.pi, np.pi)
    if shape == 'lobes':
        return replace(bell, lobes=(rng.uniform(0.3, 0.7), int(rng.integers(2, 4)), angle))
    if shape == 'squeezed':
        return replace(bell, squeeze=rng.choice([-1.0, 1.0]) * rng.uniform(0.3, 0.8))
    if shape == 'two_rings':
        far = np.array([0.3, 0.4, 0.5, 1.6, 1.8])
        return replace(bell, ring_m=ring * far, soft_m=0.6 * soft)
    if shape == 'off_centre':
        aside = rng.uniform(0.25, 0.6) * ring
        return replace(bell, centre_m=(aside * np.cos(angle), aside * np.sin(angle)),
                       squeeze=rng.uniform(0.1, 0.3))  # fmt: skip
    return bell


def draw_plate(rng: np.random.Generator, relief: bool) -> Plate:
    half = rng.uniform(0.25, 0.45), rng.uniform(0.22, 0.4)
    if not relief:
        return Plate(half)
    up, down = rng.uniform(0.008, 0.03), -rng.uniform(0.008, 0.03)
    beads = ((up, half[1] * rng.uniform(0.2, 0.7), rng.uniform(0.04, 0.09)),
             (down, -half[1] * rng.uniform(0.2, 0.7), rng.uniform(0.05, 0.1)))  # fmt: skip
    return Plate(half, (rng.uniform(0.1, 0.6), rng.uniform(0.1, 0.6)), beads)


def draw_run(
    rng: np.random.Generator, plate: Plate, bell: Bell, film_um: float, standoff_m: float,
    upward: bool, roll: float, close: bool,
) -> Run:  # fmt: skip
    along, across = plate.half_m[::-1] if upward else plate.half_m
    track = bell.track_m
    index = track * rng.uniform(0.4, 0.8)
    count = int(np.clip(round(2 * across / index) + 1, 1, 6))
    count = 1 if rng.random() < 0.2 else count
    open_past = rng.uniform(-0.015, 0.05) if close else 0.9 * track + 0.05
    past = open_past + rng.uniform(0.02, 0.08)
    speed = bell.flow_cm3_per_s / (film_um * (index if count > 1 else track))
    way = np.array([0.0, 0.0, 1.0]) if upward else np.array([1.0, 0.0, 0.0])
    side = np.array([1.0, 0.0, 0.0]) if upward else np.array([0.0, 0.0, -1.0])
    follow, begins, ends, axes, starts, opens, clock = rng.random(), [], [], [], [], [], 0.0
    for k, off in enumerate((np.arange(count) - 0.5 * (count - 1)) * index):
        at = np.clip(off * side[[0, 2]], -np.array(plate.half_m), plate.half_m)
        point, normal, _ = plate.frame(at[:1], at[1:])
        axis = -(follow * normal[0] + (1 - follow) * np.array([0.0, 1.0, 0.0]))
        axis /= np.linalg.norm(axis)
        aim = off * side + [0.0, point[0, 1] + rng.normal(0, 0.002), 0.0]
        forth = way if k % 2 == 0 else -way
        begins.append(aim - standoff_m * axis - (along + past) * forth)
        ends.append(aim - standoff_m * axis + (along + past) * forth)
        axes.append(axis)
        if k:
            clock += 0.4 + np.linalg.norm(begins[-1] - ends[-2]) / speed
        starts.append(clock)
        lead = (past - open_past) / speed
        clock += 2 * (along + past) / speed
        opens.append((starts[-1] + lead, clock - lead))
    tool_x = np.array([np.cos(roll), 0.0, np.sin(roll)])
    return Run(*(np.array(each) for each in (begins, ends, axes)), tool_x, speed,
               np.array(starts), np.array(opens))  # fmt: skip


def draw_hidden(rng: np.random.Generator, name: str) -> dict:
    """Sizes of what is hidden."""
    power = rng.random()

    def size(low: float, high: float) -> float:
        return float(low * (high / low) ** power)

    sign, angle = rng.choice([-1.0, 1.0]), rng.uniform(0, 2 * np.pi)
    side = np.array([np.cos(angle), np.sin(angle)])
    wind = np.array([0.0, 0.0, -1.0] if rng.random() < 0.7 else [sign, 0.0, 0.0])
    return {
        'air_drift': lambda: {'wind_m_per_s': size(0.25, 2.5) * wind},
        'tcp_offset': lambda: {'m': size(0.004, 0.03) * side},
        'part_misalignment': lambda: {'m': size(0.004, 0.03) * side},
        'tcp_tilt': lambda: {'rad': size(0.025, 0.17) * side},
        'sag': lambda: {'mm_at_20um': size(2.0, 14.0)},
        'pattern_spread': lambda: {'entrained': size(0.15, 0.6)},
        'standoff_efficiency': lambda: {'light': size(0.02, 0.5)},
        'tcp_standoff': lambda: {'m': sign * size(0.006, 0.045)},
        'incidence_attraction': lambda: {'pull': size(0.4, 4.0)},
        'convex_attraction': lambda: {'per_mm': size(0.02, 0.25)},
        'faraday_shielding': lambda: {'per_mm': size(0.02, 0.25)},
        'gauge_curvature_bias': lambda: {'um_m': size(0.2, 1.8)},
        'gun_wake': lambda: {'s': size(0.02, 0.12)},
        'pose_lag': lambda: {'s': size(0.02, 0.12)},
        'trigger_lag': lambda: {'s': size(0.03, 0.25)},
        'corner_slowdown': lambda: {'gain': size(0.15, 1.5), 'reach_m': rng.uniform(0.08, 0.25)},
        'edge_build': lambda: {'gain': size(0.1, 0.9), 'reach_m': rng.uniform(0.008, 0.03)},
        'flow_drift': lambda: {'end': sign * size(0.06, 0.6)},
        'fog_gradient': lambda: {'um': size(1.0, 10.0)},
        'overspray_fog': lambda: {'um': size(0.8, 8.0)},
        'gauge_zero': lambda: {'um': sign * size(0.8, 6.0)},
        'unknown:eddy': lambda: {'m': size(0.01, 0.06), 'turn_s': rng.uniform(1.0, 4.0)},
        'unknown:wet_patch': lambda: {'gain': sign * size(0.1, 0.6),
                                      'at': rng.uniform(-0.6, 0.6, 2),
                                      'reach_m': rng.uniform(0.05, 0.12)},
        'unknown:diagonal': lambda: {'gain': size(0.06, 0.4), 'way': side},
        'unknown:surge': lambda: {'gain': size(0.15, 1.2), 'at': rng.uniform(0.1, 0.9, 3),
                                  'long': rng.uniform(0.02, 0.06)},
    }[name]()  # fmt: skip


@dataclass(frozen=True)
class Noise:
    """Of gauge and film: all as standard deviations."""

    gauge_um: float
    share: float
    texture: float  # of the film, alike over `reach_m`
    reach_m: float
    level: float
    zero_um: float

    def sigma_um(self, film_um):
        return np.hypot(self.gauge_um, self.share * film_um)

    def waves(self, rng: np.random.Generator, x, z, count: int = 40) -> np.ndarray:
        """A smooth random field of standard deviation `texture`."""
        wave = rng.normal(size=(count, 2)) / self.reach_m
        angle = np.stack([x, z], 1) @ wave.T + rng.uniform(0, 2 * np.pi, count)
        return self.texture * np.sqrt(2 / count) * np.cos(angle).sum(axis=1)


def paint(
    seed: int, kind: str, effects: tuple[str, ...] | None = None, bell: Bell | None = None
) -> Painted:
    """The campaign of a seed; `effects` and `bell` are taken instead of a draw."""
    rng = np.random.default_rng([82, seed])
    names = _names(rng, kind) if effects is None else effects
    shape = names[0].partition(':')[2] if kind == 'footprint' else ''
    drawn = draw_bell(rng, shape)
    bell = drawn if bell is None else bell
    hidden = {name: draw_hidden(rng, name) for name in names if kind != 'footprint'}
    families = {EFFECTS.get(name) for name in names}
    count = int(rng.integers(1, 5))
    if families & {'distance', 'aside'}:
        count = max(count, 2)
    plates = [draw_plate(rng, 'relief' in families or 'field' in families or rng.random() < 0.5)
              for _ in range(count)]  # fmt: skip
    close = rng.random() < (0.8 if 'ends' in families else 0.35)
    standoffs = rng.uniform(0.2, 0.32, count)
    if 'distance' in families:
        standoffs[:2] = rng.uniform(0.15, 0.2), rng.uniform(0.3, 0.38)
    film, roll = rng.uniform(12.0, 32.0), rng.uniform(-np.pi, np.pi)
    runs = [draw_run(rng, plate, bell, film, standoff, bool(rng.random() < 0.35),
                     roll + np.pi * (rng.random() < 0.3), close)
            for plate, standoff in zip(plates, standoffs, strict=True)]  # fmt: skip
    ranges = ((0.3, 0.9), (0.0, 0.012), (0.004, 0.02), (0.01, 0.05), (0.01, 0.05), (0.2, 0.8))
    noise = Noise(*(float(rng.uniform(*limits)) for limits in ranges))
    times = int(rng.choice([0, 1, 2, 3], p=[0.4, 0.1, 0.35, 0.15]))  # 0: noise is stated
    readings = max(int(rng.uniform(50.0, 280.0) / count) // max(times, 1), 12)
    parts, judged = zip(*(
        _gauged(rng, f'plate_{k + 1}', plate, run, bell, hidden, noise, times, readings)
        for k, (plate, run) in enumerate(zip(plates, runs, strict=True))
    ), strict=True)  # fmt: skip
    together, *each = strengths(judged)
    facts = {'shape': shape or 'round', 'noise_from': ('stated', 'nothing', 'repeats', 'repeats')[
        times], 'sizes': {n: {k: np.round(v, 4).tolist() for k, v in h.items()}
                          for n, h in hidden.items()}}  # fmt: skip
    # A wind and a wake that act by size are no amount of the library.
    same = {n: h for n, h in hidden.items() if n not in ('air_drift', 'gun_wake')}
    return Painted('jet', seed, kind, names, parts, together, tuple(each), amounts(same),
                   noise.level, noise.zero_um, facts)  # fmt: skip


def _names(rng: np.random.Generator, kind: str) -> tuple[str, ...]:
    if kind == 'clean':
        return ()
    if kind in ('unknown', 'footprint'):
        return (f'{kind}:{rng.choice(UNKNOWN if kind == "unknown" else FOOTPRINTS)}',)
    if kind == 'effect':
        return (str(rng.choice(list(EFFECTS))),)
    while True:
        one, other = rng.choice(list(EFFECTS), 2, replace=False)
        if EFFECTS[one] != EFFECTS[other]:
            return str(one), str(other)


def _gauged(
    rng, name: str, plate: Plate, run: Run, bell: Bell, hidden: Hidden, noise: Noise, times: int,
    count: int,
) -> tuple[Part, Judged]:  # fmt: skip
    """The part with readings, and what the judge needs of its points."""
    room = np.array(plate.half_m) - NEAR_EDGE_M
    x, z = (rng.uniform(-1.0, 1.0, (count + UNSEEN, 2)) * room).T
    if rng.random() < 0.6:  # a grid, as one draws it with a ruler
        wide = int(np.clip(round(np.sqrt(count * room[0] / room[1])), 2, count // 2))
        x[:count] = (np.arange(count) % wide / (wide - 1) * 2 - 1) * room[0]
        z[:count] = (np.arange(count) // wide / max((count - 1) // wide, 1) * 2 - 1) * room[1]
    plain, true = (shown_um(plate, run, bell, h, x, z) for h in ({}, hidden))
    level, zero = 1 + noise.level * rng.normal(), noise.zero_um * rng.normal()
    lasting = true * level + zero
    uneven = lasting + noise.waves(rng, x, z) * true
    reps = max(times, 1)
    sigma = noise.sigma_um(true)
    seen = np.tile(uneven[:count], reps)
    seen = seen + np.tile(sigma[:count], reps) * rng.normal(size=len(seen))
    read = x[:count], z[:count]
    plain, film = plain[:count], true[:count]
    marks = [film - plain] * (2 if len(hidden) == 1 else 1)
    if len(hidden) > 1:
        marks += [shown_um(plate, run, bell, {n: h}, *read) - plain for n, h in hidden.items()]
    pattern = []
    for k, width in enumerate(Bell.FREE):
        other = replace(bell, free=np.where(np.arange(len(Bell.FREE)) == k, 0.02 * width, 0.0))
        pattern.append((shown_um(plate, run, other, {}, *read) - plain) / 0.02)
    blotchy = np.stack([noise.waves(rng, *read) * film for _ in range(40)], 1)
    own = np.column_stack([noise.level * film, np.full(count, noise.zero_um),
                           blotchy / np.sqrt(40)])  # fmt: skip
    judged = Judged(np.stack(marks, 1), np.stack(pattern, 1), own, sigma[:count] / np.sqrt(reps))
    wide, high = plate.half_m
    grid = np.linspace(-wide, wide, int(wide / 0.006)), np.linspace(-high, high, int(high / 0.006))
    stamps, tcp, quaternions = run.log()
    at = plate.frame(x, z)[0]
    part = Part(
        name, *grid_mesh(plate.y(*np.meshgrid(*grid)), *grid),
        BEGUN_NS + np.rint(1e9 * stamps).astype(np.int64), tcp, quaternions,
        *trigger(BEGUN_NS, run.open_s), np.tile(at[:count], (reps, 1)),
        np.tile([f'{k + 1}' for k in range(count)], reps), np.maximum(np.round(seen, 1), 0.0),
        sigma[:count] if times == 0 else None,
        at[count:], lasting[count:], np.hypot(sigma, noise.texture * true)[count:],
    )  # fmt: skip
    return part, judged
