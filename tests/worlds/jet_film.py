"""The film of a gun's run over a plate in the jet's world, with the physics that is hidden.

Each hidden effect adds what is missing. Films are sums over five sizes of drops.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from .jet_drops import (
    DIAMETER_M,
    HEIGHTS_M,
    REFERENCE_M,
    SHARE,
    SIZES,
    Bell,
    arriving,
    drawn_in,
    flights,
)

MOUTH_M = 0.05  # emission behind the TCP
HOLLOW_M = 0.04  # reach over which a field feels a recess
BY_SIZE = {'air_drift', 'gun_wake', 'standoff_efficiency', 'incidence_attraction'}

Hidden = dict[str, dict]


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


def flow_of(run: Run, time_s: np.ndarray, hidden: Hidden) -> np.ndarray:
    """Flow over the usual one: a valve and a pump behind it, each a lag of first order."""
    late_s = time_s + hidden.get('pose_lag', {'s': 0.0})['s']

    def answer(since):
        if 'trigger_lag' not in hidden:
            return (since > 0.0).astype(float)
        t = np.maximum(since, 0.0) / hidden['trigger_lag']['s']
        return 1.0 - (1.0 + t) * np.exp(-t)

    opens, closes = (answer(late_s[:, None] - at) for at in run.open_s.T)
    flow = np.sum(opens - closes, axis=1)
    whole = run.open_s[-1, 1]
    if drift := hidden.get('flow_drift'):
        flow = flow * (1 + drift['end'] * (np.sqrt(np.clip(late_s / whole, 0, 1)) - 2 / 3))
    if surge := hidden.get('unknown:surge'):
        for at in surge['at']:
            away = np.abs(late_s / whole - at)
            flow = flow * (1 + surge['gain'] * np.exp(-away / surge['long']))
    return flow


def landed_um(
    plate: Plate, run: Run, bell: Bell, hidden: Hidden, x: np.ndarray, z: np.ndarray
) -> np.ndarray:
    """Film of all strokes at points (n,), summed over drops of all sizes."""
    point, normal, _ = plate.frame(x, z)
    total = np.zeros(len(x))
    for k in range(len(run.axis)):
        long = np.linalg.norm(run.end_m[k] - run.begin_m[k])
        count = int(long / 0.012) + 1
        share = (np.arange(count) + 0.5) / count
        tool, tcp = run.tool(k), run.begin_m[k] + share[:, None] * (run.end_m[k] - run.begin_m[k])
        fine = ((np.arange(8 * count) + 0.5) / (8 * count)) * run.lasts_s[k] + run.starts_s[k]
        dose = flow_of(run, fine, hidden).reshape(count, 8).mean(axis=1)
        dose = dose * run.lasts_s[k] / count * bell.flow_cm3_per_s
        if slow := hidden.get('corner_slowdown'):
            ease = np.clip(np.minimum(share, 1 - share) * long / slow['reach_m'], 0, 1)
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
        if eddy := hidden.get('unknown:eddy'):
            angle = 2 * np.pi * (run.starts_s[k] + share * run.lasts_s[k]) / eddy['turn_s']
            swing = eddy['m'] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
            seen[:, :, :2] -= swing[None]
        if not hidden.keys() & BY_SIZE:
            density = bell.density(seen[:, :, 0] / magnified, seen[:, :, 1] / magnified)
            total += (np.sum(SHARE[:, None, None] * density, axis=0) * catch) @ dose
            continue
        flux = np.zeros_like(catch)
        light = hidden.get('standoff_efficiency')
        hit = arriving(deep, light['light']) if light else np.ones(5)
        pull = hidden.get('incidence_attraction', {'pull': 0.0})['pull']
        charge = pull * (DIAMETER_M[2] / DIAMETER_M)  # small drops drift the faster
        shift = _aside(run, k, tool, deep, hidden)
        for size in SIZES:
            u, v = ((seen[:, :, axis] - shift[size, ..., axis]) / magnified for axis in (0, 1))
            drift = (cosine + charge[size]) / (1 + charge[size]) / np.maximum(cosine, 0.05)
            one = SHARE[size] * bell.density(u, v, [size])[0]
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
    for size in SIZES:
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
