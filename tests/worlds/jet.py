"""A world of drops in an air jet: five sizes, a jet that slows down, a field, and a draught.

Air leaves the bell as a jet whose streamlines are straight rays; drops of each size enter it on a
ring of their own and follow it, so that without further physics the pattern grows as a cone. Each
hidden effect adds the physics that is missing: air drawn into the jet, drops too light to reach
the wall, a draught that takes the small ones first, a field toward the skin. Trajectories are
integrated once for each setting into tables over the standoff; films are sums over sizes.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from .record import Painted, Part, detectability, grid_mesh

MOUTH_M, REFERENCE_M = 0.05, 0.30  # emission behind the TCP; distance at which patterns are given
# Drops: diameter, share of the volume, and what follows for paint of 1000 kg/m3 in air.
DIAMETER_M = 1e-6 * np.array([12.0, 20.0, 30.0, 42.0, 60.0])
SHARE = np.array([0.08, 0.2, 0.32, 0.27, 0.13])
RELAX_S = 1000.0 * DIAMETER_M**2 / (18.0 * 1.8e-5)
JET_M_PER_S, CORE_M = 25.0, 0.06  # the jet's axis: 25 m/s up to 60 mm, then as 1 / distance
HEIGHTS_M = np.linspace(0.12, 0.52, 9)
TIME_STEPS = 400
UNSEEN, NEAR_EDGE_M = 60, 0.015
HOLLOW_M = 0.04  # reach over which a field feels a recess

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
UNKNOWN = ('eddy', 'wet_patch', 'diagonal', 'surge')
FOOTPRINTS = ('lobes', 'squeezed', 'two_rings', 'off_centre')


def family_of(name: str) -> str | None:
    return next((f for f, names in FAMILIES.items() if name in names), None)


# --- drops in the jet


def air_m_per_s(distance_m: np.ndarray) -> np.ndarray:
    """Speed of the air on the jet's axis."""
    return JET_M_PER_S / np.maximum(distance_m / CORE_M, 1.0)


@cache
def flights() -> tuple[np.ndarray, np.ndarray]:
    """(sizes, heights) time of flight [s] and lag [s] of a cross-wind's hold on the drops.

    A drop in a cross-wind w lands w x lag aside: it takes up the wind only as it relaxes, and
    meets the wind in full only where the jet has slowed down.
    """
    time, aside = (np.zeros((len(RELAX_S), len(HEIGHTS_M))) for _ in range(2))
    for k, relax in enumerate(RELAX_S):
        # Speed, place, sidewise speed and shift in a wind of 1 m/s, by exponential steps.
        distance, speed, cross, shift, clock = 0.01, JET_M_PER_S, 0.0, 0.0, 0.0
        step = 1.2 * HEIGHTS_M[-1] / TIME_STEPS
        ways, clocks, shifts = [0.0], [0.0], [0.0]
        for _ in range(2 * TIME_STEPS):
            now = step / speed
            hold = np.exp(-now / relax)
            air = air_m_per_s(distance)
            speed = air + (speed - air) * hold
            wind = 1.0 / (1.0 + air / 4.0)
            cross = wind + (cross - wind) * hold
            distance, clock, shift = distance + step, clock + now, shift + cross * now
            ways.append(distance), clocks.append(clock), shifts.append(shift)
            if distance > HEIGHTS_M[-1]:
                break
        time[k] = np.interp(HEIGHTS_M, ways, clocks)
        aside[k] = np.interp(HEIGHTS_M, ways, shifts)
    return time, aside


def arriving(depth_m: np.ndarray, light: float) -> np.ndarray:
    """(sizes, ...) share of the drops that leave the air which turns aside before the wall.

    By their Stokes number in a stagnating jet; `light` sets how much of it is missed, and at the
    reference distance the whole pattern is what it is given as.
    """

    def caught(depth_m):
        stokes = RELAX_S.reshape(-1, *(1,) * np.ndim(depth_m)) * air_m_per_s(depth_m)
        stokes = stokes / (light * 0.05)
        return stokes**2 / (stokes + 0.25) ** 2

    return caught(depth_m) / np.tensordot(SHARE, caught(np.asarray(REFERENCE_M)), (0, 0))


def drawn_in(depth_m: np.ndarray, entrained: float) -> np.ndarray:
    """How far out a ray has got at a distance over a straight one, 1 at the reference distance.

    Air that the jet draws in carries drops toward the axis, most while the jet is thin: the ray
    obeys dr/dx = r/x - e r / (x + 50 mm).
    """
    return ((depth_m + 0.05) / (REFERENCE_M + 0.05)) ** -entrained


# --- the bell


@dataclass(frozen=True)
class Bell:
    """Rings on which drops of each size cross the reference plane."""

    flow_cm3_per_s: float
    ring_m: np.ndarray  # (sizes,) radius
    soft_m: np.ndarray  # (sizes,) spread
    lobes: tuple[float, int, float] = (0.0, 1, 0.0)  # size, number, angle
    squeeze: float = 0.0
    centre_m: tuple[float, float] = (0.0, 0.0)
    free: np.ndarray = field(default_factory=lambda: np.zeros(9))

    # Standard deviations of what a judge takes as free in a bell.
    FREE = np.array([0.5, 0.25, 0.25, 0.2, 0.2, 0.3, 0.3, 0.15, 0.15])

    def density(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """(sizes, ...) share of the flow a square metre of the reference plane."""
        level, wide, soft, heavy, light, lean_u, lean_v, squeeze, turned = self.free
        stretch = np.exp(0.5 * (self.squeeze + squeeze))
        u, v = (u - self.centre_m[0]) / stretch, (v - self.centre_m[1]) * stretch
        u, v = u + turned * v, v
        reach, found = np.hypot(u, v), []
        around = np.arctan2(v, u)
        size, number, at = self.lobes
        uneven = 1.0 + size * np.cos(number * (around - at))
        uneven = uneven + (lean_u * u + lean_v * v) / (reach + 1e-3 + self.ring_m[2])
        weights = np.exp(level) * (1 + heavy * np.linspace(-1, 1, 5) + light * np.cos(
            np.linspace(0, np.pi, 5) * 2))  # fmt: skip
        for ring, width, weight in zip(
            self.ring_m * np.exp(wide), self.soft_m * np.exp(soft), weights, strict=True
        ):
            # A ring drawn soft, normed over the plane by its moments.
            edge = np.exp(-0.5 * ((reach - ring) / width) ** 2)
            edge = edge + np.exp(-0.5 * ((reach + ring) / width) ** 2)
            found.append(weight * edge * uneven / _ring_area(ring, width))
        return np.maximum(np.stack(found), 0.0)

    @property
    def track_m(self) -> float:
        """Paint of a pass over its peak: the width of a box."""
        line = np.linspace(-0.6, 0.6, 241)
        table = np.tensordot(SHARE, self.density(*np.meshgrid(line, line)), 1)
        return float(1.0 / (table.sum(axis=0).max() * (line[1] - line[0])))


def _ring_area(ring: float, width: float) -> float:
    reach = np.linspace(0.0, ring + 6 * width, 400)
    edge = np.exp(-0.5 * ((reach - ring) / width) ** 2)
    edge = edge + np.exp(-0.5 * ((reach + ring) / width) ** 2)
    return float(2 * np.pi * np.trapezoid(edge * reach, reach))


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


# --- parts and jobs


@dataclass(frozen=True)
class Plate:
    """A pressed sheet y = relief(x, z): flat, or with a crown, a bead and a trough."""

    half_m: tuple[float, float]
    crown_per_m: tuple[float, float] = (0.0, 0.0)
    beads: tuple[tuple[float, float, float], ...] = ()  # height, place in z, breadth

    def y(self, x, z):
        total = -0.5 * (self.crown_per_m[0] * x**2 + self.crown_per_m[1] * z**2)
        for high, at, broad in self.beads:
            total = total + high / (1.0 + ((z - at) / broad) ** 2)
        return total

    def frame(self, x, z) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points (n, 3), outward normals (n, 3), and sum of curvatures (n,), + hollow."""
        y_x, y_z = -self.crown_per_m[0] * x, -self.crown_per_m[1] * z
        bent = -self.crown_per_m[0] - self.crown_per_m[1] + 0.0 * x
        for high, at, broad in self.beads:
            q = (z - at) / broad
            y_z = y_z - 2 * high * q / (1 + q**2) ** 2 / broad
            bent = bent + high * (6 * q**2 - 2) / (1 + q**2) ** 3 / broad**2
        normal = np.stack([-y_x, np.ones_like(x), -y_z], axis=1)
        long = np.linalg.norm(normal, axis=1)
        return np.stack([x, self.y(x, z), z], 1), normal / long[:, None], bent / long**3

    def depth_m(self, x, z):
        """How deep a place lies below its surroundings: what a field does not reach into."""
        ring = np.arange(12) * np.pi / 6
        around = [self.y(x + HOLLOW_M * np.cos(a), z + HOLLOW_M * np.sin(a)) for a in ring]
        return np.mean(around, axis=0) - self.y(x, z)

    def inward_m(self, x, z):
        return np.minimum(self.half_m[0] - np.abs(x), self.half_m[1] - np.abs(z))


def draw_plate(rng: np.random.Generator, relief: bool) -> Plate:
    half = rng.uniform(0.25, 0.45), rng.uniform(0.22, 0.4)
    if not relief:
        return Plate(half)
    up, down = rng.uniform(0.008, 0.03), -rng.uniform(0.008, 0.03)
    beads = ((up, half[1] * rng.uniform(0.2, 0.7), rng.uniform(0.04, 0.09)),
             (down, -half[1] * rng.uniform(0.2, 0.7), rng.uniform(0.05, 0.1)))  # fmt: skip
    return Plate(half, (rng.uniform(0.1, 0.6), rng.uniform(0.1, 0.6)), beads)


@dataclass(frozen=True)
class Run:
    """The gun's way in straight strokes, as a controller would interpolate them.

    Attributes:
        begin_m, end_m: (k, 3) TCP at the strokes' ends; strokes are joined by links, gun closed.
        axis: (k, 3) direction in which the gun looks on each stroke.
        across: (3,) tool x, before it is made square to the axis.
        starts_s: (k,) when each stroke begins; open_s: (k, 2) when the gun opens and closes.
    """

    begin_m: np.ndarray
    end_m: np.ndarray
    axis: np.ndarray
    across: np.ndarray
    speed_m_per_s: float
    starts_s: np.ndarray
    open_s: np.ndarray

    @property
    def lasts_s(self) -> np.ndarray:
        return np.linalg.norm(self.end_m - self.begin_m, axis=1) / self.speed_m_per_s

    def tool(self, stroke: int) -> np.ndarray:
        z = self.axis[stroke]
        x = self.across - (self.across @ z) * z
        x /= np.linalg.norm(x)
        return np.stack([x, np.cross(z, x), z], axis=1)

    def log(self, every_m: float = 0.02) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times, TCP and quaternions as recorded, links between strokes included."""
        stamps, places, turns = [], [], []
        for k, (begin, end) in enumerate(zip(self.begin_m, self.end_m, strict=True)):
            count = int(np.linalg.norm(end - begin) / every_m) + 2
            share = np.linspace(0.0, 1.0, count)[:, None]
            stamps.append(self.starts_s[k] + share[:, 0] * self.lasts_s[k])
            places.append(begin + share * (end - begin))
            turns.append(np.tile(Rotation.from_matrix(self.tool(k)).as_quat(), (count, 1)))
            if k + 1 < len(self.axis):
                gap = self.starts_s[k + 1] - stamps[-1][-1]
                share = np.arange(1, int(gap / 0.1) + 1)[:, None] * 0.1 / gap
                share = share[share[:, 0] < 0.999]
                stamps.append(stamps[-1][-1] + share[:, 0] * gap)
                places.append(end + share * (self.begin_m[k + 1] - end))
                turns.append(np.tile(turns[-1][-1], (len(share), 1)))
        return np.concatenate(stamps), np.concatenate(places), np.concatenate(turns)


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


# --- what is hidden


def draw_hidden(rng: np.random.Generator, name: str) -> dict:
    """Sizes of what is hidden."""
    power = rng.random()

    def from_to(low: float, high: float) -> float:
        return float(low * (high / low) ** power)

    sign, angle = rng.choice([-1.0, 1.0]), rng.uniform(0, 2 * np.pi)
    round_ = np.array([np.cos(angle), np.sin(angle)])
    wind = [0.0, 0.0, -1.0] if rng.random() < 0.7 else [sign, 0.0, 0.0]
    match name.removeprefix('unknown:'):
        case 'air_drift':
            return {'wind_m_per_s': from_to(0.25, 2.5) * np.array(wind)}
        case 'tcp_offset' | 'part_misalignment':
            return {'m': from_to(0.004, 0.03) * round_}
        case 'tcp_tilt':
            return {'rad': from_to(0.025, 0.17) * round_}
        case 'sag':
            return {'mm_at_20um': from_to(2.0, 14.0)}
        case 'pattern_spread':
            return {'entrained': from_to(0.15, 0.6)}
        case 'standoff_efficiency':
            return {'light': from_to(0.02, 0.5)}
        case 'tcp_standoff':
            return {'m': sign * from_to(0.006, 0.045)}
        case 'incidence_attraction':
            return {'pull': from_to(0.4, 4.0)}
        case 'convex_attraction' | 'faraday_shielding':
            return {'per_mm': from_to(0.02, 0.25)}
        case 'gauge_curvature_bias':
            return {'um_m': from_to(0.2, 1.8)}
        case 'gun_wake' | 'pose_lag':
            return {'s': from_to(0.02, 0.12)}
        case 'trigger_lag':
            return {'s': from_to(0.03, 0.25)}
        case 'corner_slowdown':
            return {'gain': from_to(0.15, 1.5), 'reach_m': rng.uniform(0.08, 0.25)}
        case 'edge_build':
            return {'gain': from_to(0.1, 0.9), 'reach_m': rng.uniform(0.008, 0.03)}
        case 'flow_drift':
            return {'end': sign * from_to(0.06, 0.6)}
        case 'fog_gradient':
            return {'um': from_to(1.0, 10.0)}
        case 'overspray_fog':
            return {'um': from_to(0.8, 8.0)}
        case 'gauge_zero':
            return {'um': sign * from_to(0.8, 6.0)}
        case 'eddy':
            return {'m': from_to(0.01, 0.06), 'turn_s': rng.uniform(1.0, 4.0)}
        case 'wet_patch':
            return {'gain': sign * from_to(0.1, 0.6), 'at': rng.uniform(-0.6, 0.6, 2),
                    'reach_m': rng.uniform(0.05, 0.12)}  # fmt: skip
        case 'diagonal':
            return {'gain': from_to(0.06, 0.4), 'way': round_}
        case 'surge':
            return {'gain': from_to(0.15, 1.2), 'at': rng.uniform(0.1, 0.9, 3),
                    'long': rng.uniform(0.02, 0.06)}  # fmt: skip
    return {}


Hidden = dict[str, dict]


def flow_of(run: Run, time_s: np.ndarray, hidden: Hidden) -> np.ndarray:
    """Flow over the usual one: a valve and a pump behind it, each a lag of first order."""
    late_s = time_s + hidden.get('pose_lag', {'s': 0.0})['s']
    opens, closes = run.open_s.T

    def answer(since):
        if 'trigger_lag' not in hidden:
            return (since > 0.0).astype(float)
        t = np.maximum(since, 0.0) / hidden['trigger_lag']['s']
        return 1.0 - (1.0 + t) * np.exp(-t)

    flow = np.sum(answer(late_s[:, None] - opens) - answer(late_s[:, None] - closes), axis=1)
    whole = run.open_s[-1, 1]
    if drift := hidden.get('flow_drift'):
        flow = flow * (1 + drift['end'] * (np.sqrt(np.clip(late_s / whole, 0, 1)) - 2 / 3))
    if surge := hidden.get('unknown:surge'):
        for at in surge['at']:
            flow = flow * (1 + surge['gain'] * np.exp(-np.abs(late_s / whole - at)
                                                      / surge['long']))  # fmt: skip
    return flow


def landed_um(
    plate: Plate, run: Run, bell: Bell, hidden: Hidden, x: np.ndarray, z: np.ndarray
) -> np.ndarray:
    """Film of all strokes at points (n,), summed over drops of all sizes."""
    point, normal, _ = plate.frame(x, z)
    by_size = bool(hidden.keys() & {'air_drift', 'gun_wake', 'standoff_efficiency',
                                    'incidence_attraction'})  # fmt: skip
    shares = SHARE[:, None, None]
    total = np.zeros(len(x))
    for k in range(len(run.axis)):
        count = int(np.linalg.norm(run.end_m[k] - run.begin_m[k]) / 0.012) + 1
        share = (np.arange(count) + 0.5) / count
        tool, tcp = run.tool(k), run.begin_m[k] + share[:, None] * (run.end_m[k] - run.begin_m[k])
        fine = ((np.arange(8 * count) + 0.5) / (8 * count)) * run.lasts_s[k] + run.starts_s[k]
        dose = flow_of(run, fine, hidden).reshape(count, 8).mean(axis=1)
        dose = dose * run.lasts_s[k] / count * bell.flow_cm3_per_s
        if slow := hidden.get('corner_slowdown'):
            to_end = np.minimum(share, 1 - share) * np.linalg.norm(run.end_m[k] - run.begin_m[k])
            ease = np.clip(to_end / slow['reach_m'], 0, 1)
            dose = dose * (1 + slow['gain'] * (1 - ease**3 * (10 - 15 * ease + 6 * ease**2)))
        tcp, tool = _really(tcp, tool, hidden)
        seen = (point[:, None] - tcp) @ tool
        seen[:, :, 2] += MOUTH_M
        deep = np.maximum(seen[:, :, 2], 0.02)
        ray = np.linalg.norm(seen, axis=2)
        cosine = np.clip(-np.einsum('nsj,nj->ns', seen, normal @ tool) / ray, 0.0, 1.0)
        magnified = deep / REFERENCE_M
        if draw := hidden.get('pattern_spread'):
            magnified = magnified * drawn_in(deep, draw['entrained'])
        # Of the flow through a patch of the reference plane, what a tilted patch catches.
        catch = cosine * ray / deep / magnified**2 * (seen[:, :, 2] > 0)
        shift = _aside(run, k, tool, deep, hidden) if by_size else None
        if eddy := hidden.get('unknown:eddy'):
            angle = 2 * np.pi * (run.starts_s[k] + share * run.lasts_s[k]) / eddy['turn_s']
            swing = eddy['m'] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
            seen[:, :, :2] -= swing[None]
        if shift is None:
            u, v = seen[:, :, 0] / magnified, seen[:, :, 1] / magnified
            flux = np.sum(shares * bell.density(u, v), axis=0) * catch
        else:
            flux = np.zeros_like(catch)
            light = hidden.get('standoff_efficiency')
            hit = arriving(deep, light['light']) if light else np.ones(5)
            pull = hidden.get('incidence_attraction', {'pull': 0.0})['pull']
            charge = pull * (DIAMETER_M[2] / DIAMETER_M)  # small drops drift the faster
            for size in range(len(SHARE)):
                u = (seen[:, :, 0] - shift[size, ..., 0]) / magnified
                v = (seen[:, :, 1] - shift[size, ..., 1]) / magnified
                drift = (cosine + charge[size]) / (1 + charge[size]) / np.maximum(cosine, 0.05)
                one = SHARE[size] * bell.density(u, v)[size]
                flux += one * catch * hit[size] * np.where(cosine > 0, drift, 0.0)
        total += flux @ dose
    return total


def _really(tcp, tool, hidden: Hidden) -> tuple[np.ndarray, np.ndarray]:
    """Where the gun was, and how it looked."""
    if off := hidden.get('tcp_offset'):
        tcp = tcp + tool[:, :2] @ off['m']
    if off := hidden.get('tcp_standoff'):
        tcp = tcp + off['m'] * tool[:, 2]
    if off := hidden.get('part_misalignment'):
        tcp = tcp - np.array([off['m'][0], 0.0, off['m'][1]])
    if off := hidden.get('tcp_tilt'):
        tool = tool @ Rotation.from_rotvec([*off['rad'], 0.0]).as_matrix()
    return tcp, tool


def _aside(run: Run, k: int, tool, deep, hidden: Hidden) -> np.ndarray:
    """(sizes, n, s, 2) where drops of each size land beside their ray, in the tool's x and y."""
    time, aside = flights()
    shift = np.zeros((len(SHARE), *deep.shape, 2))
    for size in range(len(SHARE)):
        if wind := hidden.get('air_drift'):
            lag = np.interp(deep, HEIGHTS_M, aside[size])
            shift[size] += lag[..., None] * (wind['wind_m_per_s'] @ tool[:, :2])
        if wake := hidden.get('gun_wake'):
            flown = np.interp(deep, HEIGHTS_M, time[size] / (SHARE @ time)[5])
            way = run.end_m[k] - run.begin_m[k]
            velocity = way / np.linalg.norm(way) * run.speed_m_per_s
            shift[size] -= wake['s'] * flown[..., None] * (velocity @ tool[:, :2])
    return shift


def shown_um(
    plate: Plate, run: Run, bell: Bell, hidden: Hidden, x: np.ndarray, z: np.ndarray
) -> np.ndarray:
    """What a gauge without noise shows at points (n,)."""
    film = landed_um(plate, run, bell, hidden, x, z)
    depth_mm = 1e3 * plate.depth_m(x, z)
    if sag := hidden.get('sag'):
        step = 0.003
        above = landed_um(plate, run, bell, hidden, x, z + step)
        # Speed of a film that runs grows as its square: what it carries, as its cube.
        run_off = 1e-3 * sag['mm_at_20um'] * np.stack([film, above]) ** 3 / 20.0**2
        film = film + (run_off[1] - run_off[0]) / step
    if attract := hidden.get('convex_attraction'):
        film = film * (1 + attract['per_mm'] * np.log1p(np.maximum(-depth_mm, 0.0)))
    if shade := hidden.get('faraday_shielding'):
        film = film / (1 + shade['per_mm'] * np.maximum(depth_mm, 0.0))
    if rim := hidden.get('edge_build'):
        film = film * (1 + rim['gain'] * np.exp(-((plate.inward_m(x, z) / rim['reach_m']) ** 2)))
    if wet := hidden.get('unknown:wet_patch'):
        far = np.hypot(x - wet['at'][0] * plate.half_m[0], z - wet['at'][1] * plate.half_m[1])
        film = film * (1 + wet['gain'] / (1 + (far / wet['reach_m']) ** 4))
    if lean := hidden.get('unknown:diagonal'):
        film = film * (1 + lean['gain'] * np.tanh((x * lean['way'][0] + z * lean['way'][1]) / 0.2))
    if fog := hidden.get('fog_gradient'):
        film = film + fog['um'] * np.exp(-(z + plate.half_m[1]) / (0.8 * plate.half_m[1]))
    for name in ('overspray_fog', 'gauge_zero'):
        film = film + hidden.get(name, {'um': 0.0})['um']
    if gauge := hidden.get('gauge_curvature_bias'):
        film = film - gauge['um_m'] * plate.frame(x, z)[2]
    return film


# --- a campaign


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
    families = {family_of(name) for name in names}
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
    ranges = {'gauge_um': (0.3, 0.9), 'share': (0.0, 0.012), 'texture': (0.004, 0.02),
              'reach_m': (0.01, 0.05), 'level': (0.01, 0.05), 'zero_um': (0.2, 0.8)}  # fmt: skip
    noise = Noise(**{name: float(rng.uniform(*limits)) for name, limits in ranges.items()})
    times = int(rng.choice([0, 1, 2, 3], p=[0.4, 0.1, 0.35, 0.15]))  # 0: noise is stated
    readings = int(rng.uniform(50.0, 280.0) / count)
    parts, marks, pattern, own, sigma = [], [], [], [], []
    for k, (plate, run) in enumerate(zip(plates, runs, strict=True)):
        part, judged = _gauged(rng, f'plate_{k + 1}', plate, run, bell, hidden, noise, times,
                               max(readings // max(times, 1), 12))  # fmt: skip
        parts.append(part)
        for every, one in zip((marks, pattern, own, sigma), judged, strict=True):
            every.append(one)
    free = np.hstack([np.concatenate(pattern), _blocks(own)])
    sizes = detectability(np.concatenate(marks), free, np.concatenate(sigma))
    facts = {'shape': shape or 'round', 'noise_from': ('stated', 'nothing', 'repeats', 'repeats')[
        times], 'sizes': {n: {k: np.round(v, 4).tolist() for k, v in h.items()}
                          for n, h in hidden.items()}}  # fmt: skip
    return Painted('jet', seed, kind, names, tuple(parts), float(sizes[0]),
                   tuple(float(s) for s in sizes[1:]), _amounts(hidden), noise.level,
                   noise.zero_um, facts)  # fmt: skip


def _names(rng: np.random.Generator, kind: str) -> tuple[str, ...]:
    if kind == 'clean':
        return ()
    if kind in ('unknown', 'footprint'):
        return (f'{kind}:{rng.choice(UNKNOWN if kind == "unknown" else FOOTPRINTS)}',)
    every = [name for names in FAMILIES.values() for name in names]
    if kind == 'effect':
        return (str(rng.choice(every)),)
    one, other = rng.choice(every, 2, replace=False)
    while family_of(one) == family_of(other):
        one, other = rng.choice(every, 2, replace=False)
    return str(one), str(other)


def _gauged(
    rng, name: str, plate: Plate, run: Run, bell: Bell, hidden: Hidden, noise: Noise, times: int,
    count: int,
) -> tuple[Part, tuple]:  # fmt: skip
    """The part with readings, and marks, pattern, own deviations and noise of its points."""
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
    ahead = slice(0, count)
    px, pz = x[ahead], z[ahead]
    alone = [true[ahead] - plain[ahead]]
    if len(hidden) > 1:
        alone += [shown_um(plate, run, bell, {n: h}, px, pz) - plain[ahead]
                  for n, h in hidden.items()]  # fmt: skip
    elif hidden:
        alone += alone
    pattern = []
    for k, width in enumerate(Bell.FREE):
        other = replace(bell, free=np.where(np.arange(len(Bell.FREE)) == k, 0.02 * width, 0.0))
        pattern.append((shown_um(plate, run, other, {}, px, pz) - plain[ahead]) / 0.02)
    blotchy = np.stack([noise.waves(rng, px, pz) * true[ahead] for _ in range(40)], 1)
    own = np.column_stack([noise.level * true[ahead], np.full(count, noise.zero_um),
                           blotchy / np.sqrt(40)])  # fmt: skip
    wide, high = plate.half_m
    grid = np.linspace(-wide, wide, int(wide / 0.006)), np.linspace(-high, high, int(high / 0.006))
    faces_of = grid_mesh(plate.y(*np.meshgrid(*grid)), *grid)
    stamps, tcp, quaternions = run.log()
    begun = 1_710_000_000_000_000_000
    at = plate.frame(x, z)[0]
    part = Part(
        name, *faces_of, begun + np.rint(1e9 * stamps).astype(np.int64), tcp, quaternions,
        begun + np.rint(1e9 * np.append(0.0, run.open_s.ravel())).astype(np.int64),
        np.append(False, np.tile([True, False], len(run.open_s))),
        np.tile(at[ahead], (reps, 1)), np.tile([f'{k + 1}' for k in range(count)], reps),
        np.maximum(np.round(seen, 1), 0.0), sigma[ahead] if times == 0 else None,
        at[count:], lasting[count:], np.hypot(sigma, noise.texture * true)[count:],
    )  # fmt: skip
    return part, (np.stack(alone, 1), np.stack(pattern, 1), own, sigma[ahead] / np.sqrt(reps))


def _blocks(own: list[np.ndarray]) -> np.ndarray:
    """Each part's own columns, zero on the other parts."""
    high, wide = np.cumsum([0, *(o.shape[0] for o in own)]), np.cumsum([0, *(
        o.shape[1] for o in own)])  # fmt: skip
    whole = np.zeros((high[-1], wide[-1]))
    for k, one in enumerate(own):
        whole[high[k] : high[k + 1], wide[k] : wide[k + 1]] = one
    return whole


def _amounts(hidden: Hidden) -> dict[str, float]:
    """True values of the library's parameters where they mean the same."""
    found = {}
    for name, sizes in hidden.items():
        match name:
            case 'tcp_offset':
                found |= dict(
                    zip(
                        ('tcp_offset.offset_x_m', 'tcp_offset.offset_y_m'), sizes['m'], strict=True
                    )
                )
            case 'tcp_tilt':
                found |= dict(
                    zip(('tcp_tilt.tilt_x_rad', 'tcp_tilt.tilt_y_rad'), sizes['rad'], strict=True)
                )
            case 'tcp_standoff':
                found['tcp_standoff.offset_z_m'] = sizes['m']
            case 'pose_lag':
                found['pose_lag.lag_s'] = sizes['s']
            case 'gauge_zero':
                found['gauge_zero.offset_um'] = sizes['um']
            case 'overspray_fog':
                found['overspray_fog.fog_um'] = sizes['um']
    return {key: float(value) for key, value in found.items()}
