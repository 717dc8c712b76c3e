"""The laws of the world of measured sprays: pattern, sheet and job, and the film with all hidden.

Straight rays carry a measured footprint to a sheet; each hidden effect follows a law of this file.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.spatial.transform import Rotation

from .measured import measured

# What a user's model is told: emission point behind the TCP, model plane before that.
EMISSION_M, PLANE_M = 0.05, 0.30
GRID, HALF_M = 181, 0.45  # of a footprint's table
KAPPA_PER_M = 4.0

Hidden = dict[str, dict]


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
        return np.minimum.reduce([0.5 * self.width_m - np.abs(x), z, self.height_m - z])


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
