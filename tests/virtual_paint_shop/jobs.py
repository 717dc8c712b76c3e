"""Paint jobs: passes over a part, the gun's motion in time, and what the controller logs of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from .doors import Part
from .flight import Slices

STEP_M = 0.003
SLICE_M = 0.012
# A gun that stands: closed before and behind, samples, and no end of a pass anywhere near.
CLOSED_S, STEP_S, FAR_M = 0.6, 0.01, 100.0
_AFTER_TRIGGER_S = np.array([0.01, 0.02, 0.04, 0.06, 0.09, 0.13, 0.18, 0.25, 0.35, 0.5])


@dataclass(frozen=True)
class Plan:
    """How a part is to be painted; lengths in metres, angles in radians."""

    direction: str = 'horizontal'
    index_m: float = 0.30
    passes: int = 4
    standoff_m: float = 0.25
    speed_m_per_s: float = 0.2
    overrun_m: float = 0.25  # TCP travel beyond the part's edges
    gun_margin_m: float = 0.20  # gun opens this far before the edge; < 0: on the part
    follow: float = 0.6  # 0 fixed tool axis, 1 along the normal
    roll_rad: float = 0.0
    teach_error_m: float = 0.004
    sample_s: float = 0.024
    from_below: bool = False  # passes from the bottom up (or the right on)
    other_way: bool = False  # each pass run from its other end
    flow: float = 1.0  # times the usual flow
    upside_down: bool = False  # the part hangs upside down; the passes are turned with it
    switched_off: tuple[str, ...] = ()  # of the cell: 'voltage', 'draught'
    brushes: tuple[int, ...] = ()  # numbers that the passes take in turn; none: one, unnumbered


@dataclass(frozen=True)
class Motion:
    """Gun motion and trigger commands. n samples about 3 mm apart, e trigger events."""

    time_s: np.ndarray
    tcp_m: np.ndarray  # (n, 3)
    turn: np.ndarray  # (n, 3, 3), columns are the tool's axes
    pass_number: np.ndarray  # (n,), -1 between passes
    reversal_m: np.ndarray  # (n,) path to the nearest end of a pass
    trigger_s: np.ndarray  # (e,)
    trigger_on: np.ndarray  # (e,) bool

    def pose(self, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """TCP (m, 3) and axes (m, 3, 3) at the times, linear between samples."""
        flat = np.concatenate([self.tcp_m, self.turn.reshape(-1, 9)], axis=1)
        at = np.stack([np.interp(time_s, self.time_s, column) for column in flat.T], axis=1)
        return at[:, :3], orthonormal(at[:, 3:].reshape(-1, 3, 3))

    def commanded(self, time_s: np.ndarray) -> np.ndarray:
        """1 where the trigger is on."""
        last = np.searchsorted(self.trigger_s, time_s, side='right') - 1
        return np.where(last < 0, False, self.trigger_on[np.maximum(last, 0)]).astype(float)


@dataclass(frozen=True)
class Log:
    """What the robot controller recorded."""

    stamps_ns: np.ndarray  # (p,) int64
    positions_m: np.ndarray  # (p, 3)
    quaternions_xyzw: np.ndarray  # (p, 4)
    trigger_stamps_ns: np.ndarray  # (e,) int64
    trigger_on: np.ndarray  # (e,) bool


@dataclass(frozen=True)
class Job:
    """An experiment before painting."""

    name: str
    part: Part
    plan: Plan
    motion: Motion

    def of_brush(self, number: int) -> Job:
        """The passes of one brush only."""
        at, on = self.motion.trigger_s, self.motion.trigger_on
        kept = np.repeat(np.resize(self.plan.brushes, len(at) // 2) == number, 2)
        motion = replace(self.motion, trigger_s=at[kept], trigger_on=on[kept])
        return replace(self, plan=replace(self.plan, brushes=()), motion=motion)


def draw_plan(
    rng: np.random.Generator, part: Part, index_m: float, half_width_m: float, direction: str,
    gun: str,
) -> Plan:  # fmt: skip
    """A believable plan; `gun` is 'outside' (spraying well past the edges) or 'near_edge'."""
    across = part.height_m if direction == 'horizontal' else part.width_m
    outside = rng.uniform(0.35, 0.60) * half_width_m
    margin = rng.uniform(0.03, 0.08) * rng.choice([-1.0, 1.0])
    return Plan(
        direction, index_m, int(np.clip(np.rint(across / index_m) + 1, 3, 6)),
        standoff_m=rng.uniform(0.20, 0.30), follow=rng.uniform(0.3, 0.9),
        overrun_m=outside + 0.04 if gun == 'outside' else rng.uniform(0.10, 0.20),
        gun_margin_m=outside if gun == 'outside' else margin,
        roll_rad=rng.choice([0.0, np.pi / 2, np.pi, rng.uniform(-np.pi, np.pi)]),
        teach_error_m=rng.uniform(0.001, 0.006),
    )  # fmt: skip


def drive(part: Part, plan: Plan, rng: np.random.Generator) -> Motion:
    """Serpentine passes from the top down (or the left on), joined by rounded links."""
    tcps, axes, numbers, fires = [], [], [], []
    along = {
        'horizontal': (-0.5 * part.width_m, 0.5 * part.width_m), 'vertical': (0.0, part.height_m),
    }[plan.direction]  # fmt: skip
    for number in range(plan.passes):
        rank = plan.passes - 1 - number if plan.from_below else number
        place = (0.5 * (plan.passes - 1) - rank) * plan.index_m
        path = np.arange(along[0] - plan.overrun_m, along[1] + plan.overrun_m, STEP_M)
        path = path if (rank % 2 == 0) != plan.other_way else path[::-1]
        tcp, axis = _pass(part, plan, rng, path, place)
        if number:
            link = int(np.linalg.norm(tcp[0] - tcps[-1][-1]) / STEP_M) + 2
            share = np.linspace(0.0, 1.0, link)[1:-1, None]
            tcps.append((1 - share) * tcps[-1][-1] + share * tcp[0])
            axes.append((1 - share) * axes[-1][-1] + share * axis[0])
            numbers.append(np.full(len(share), -1))
        opens = (path > along[0] - plan.gun_margin_m) & (path < along[1] + plan.gun_margin_m)
        fires.append(sum(map(len, tcps)) + np.flatnonzero(opens)[[0, -1]])
        tcps.append(tcp)
        axes.append(axis)
        numbers.append(np.full(len(tcp), number))
    together = (np.concatenate(each) for each in (tcps, axes, numbers, fires))
    return _in_time(*together, plan)


def across(plan: Plan) -> np.ndarray:
    return np.array([np.cos(plan.roll_rad), 0.0, np.sin(plan.roll_rad)])


def hold(part: Part, plan: Plan, place_m: np.ndarray, standoff_m: float, open_s: float) -> Motion:
    """The gun stands square before a place of the part, and is open for so long."""
    x, _, z = place_m
    normal = part.normal(np.array(x), np.array(z))
    turn = orthonormal(np.stack([across(plan), -normal, -normal], axis=-1))
    time = np.arange(0.0, open_s + 2.0 * CLOSED_S, STEP_S)
    tcp = part.point(np.array(x), np.array(z)) + standoff_m * normal
    return Motion(
        time, np.tile(tcp, (time.size, 1)), np.tile(turn, (time.size, 1, 1)),
        np.zeros(time.size, int), np.full(time.size, FAR_M),
        np.array([CLOSED_S, CLOSED_S + open_s]), np.array([True, False]),
    )  # fmt: skip


def slices(motion: Motion, flow_cm3_per_s) -> Slices:
    """Cut the spraying into short slices; `flow_cm3_per_s(times)` is the true flow."""
    travelled = np.concatenate([[0.0], np.cumsum(_steps(motion.tcp_m))])
    cuts = np.interp(np.arange(0.0, travelled[-1], SLICE_M), travelled, motion.time_s)
    after = (motion.trigger_s[:, None] + np.concatenate([[0.0], _AFTER_TRIGGER_S])).ravel()
    cuts = np.unique(np.concatenate([cuts, after[after < motion.time_s[-1]]]))
    first, last = cuts[:-1], cuts[1:]
    inner = np.minimum(1e-6, 0.25 * (last - first))
    flow_0, flow_1 = flow_cm3_per_s(first + inner), flow_cm3_per_s(last - inner)
    on = (flow_0 + flow_1) > 1e-9
    tcp_0, turn_0 = motion.pose(first[on])
    tcp_1, turn_1 = motion.pose(last[on])
    return Slices(first[on], last[on], tcp_0, tcp_1, turn_0, turn_1, flow_0[on], flow_1[on])


def record(motion: Motion, sample_s: float, rng: np.random.Generator) -> Log:
    """Stamps like a robot controller's: a nominal cycle, jitter, now and then a lost sample."""
    epoch = 1_700_000_000_000_000_000 + int(rng.integers(0, 10**15))
    ticks = np.arange(motion.time_s[0] + 0.001, motion.time_s[-1] - 0.001, sample_s)
    ticks = ticks + rng.uniform(-0.08, 0.08, ticks.size) * sample_s
    ticks = ticks[(rng.random(ticks.size) > 0.01) | (np.arange(ticks.size) == 0)]
    tcp, turn = motion.pose(ticks)
    quaternions = Rotation.from_matrix(turn).as_quat()
    flips = np.cumprod(np.where(np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0, -1, 1))
    quaternions[1:] *= flips[:, None]
    events = np.concatenate([[ticks[0]], motion.trigger_s])
    stamps, switched = (epoch + np.rint(at * 1e9).astype(np.int64) for at in (ticks, events))
    opens = np.concatenate([[False], motion.trigger_on])
    return Log(stamps, tcp, quaternions, switched, opens)


def orthonormal(turn: np.ndarray) -> np.ndarray:
    z = turn[..., 2] / np.linalg.norm(turn[..., 2], axis=-1, keepdims=True)
    x = turn[..., 0] - np.sum(turn[..., 0] * z, axis=-1, keepdims=True) * z
    x = x / np.linalg.norm(x, axis=-1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=-1)


def _pass(
    part: Part, plan: Plan, rng: np.random.Generator, path: np.ndarray, place: float
) -> tuple[np.ndarray, np.ndarray]:
    """TCP and tool axis along one pass: taught every 0.25 m or so, splined in between."""
    knots = np.linspace(path.min(), path.max(), max(int(np.ptp(path) / 0.25), 4))
    if plan.direction == 'horizontal':
        x, z = knots, np.full_like(knots, 0.5 * part.height_m + place)
    else:
        x, z = np.full_like(knots, -place), knots
    on_x = np.clip(x, -0.5 * part.width_m, 0.5 * part.width_m)
    on_z = np.clip(z, 0.0, part.height_m)
    near = [np.clip(on_z + d, 0.0, part.height_m) for d in (-0.06, -0.03, 0.0, 0.03, 0.06)]
    normal = np.mean([part.normal(on_x, z_near) for z_near in near], axis=0)
    square = np.array([0.0, 1.0, 0.0])
    axis = -((1.0 - plan.follow) * square + plan.follow * normal)
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    aim = np.stack([x, part.height(on_x, on_z), z], axis=1)
    away = plan.standoff_m + rng.normal(0.0, plan.teach_error_m, knots.size)
    tcp = aim - away[:, None] * axis
    return CubicSpline(knots, tcp)(path), CubicSpline(knots, axis)(path)


def _in_time(
    tcp: np.ndarray, axis: np.ndarray, number: np.ndarray, trigger: np.ndarray, plan: Plan
) -> Motion:
    """The way of the gun rounded, and driven: slower about the ends of passes."""
    tcp = gaussian_filter1d(tcp, 5.0, axis=0, mode='nearest')
    axis = gaussian_filter1d(axis, 12.0, axis=0, mode='nearest')
    path = np.concatenate([[0.0], np.cumsum(_steps(tcp))])
    corners = path[np.flatnonzero(np.diff(number) != 0)]
    reversal = np.full(path.size, np.inf)
    if corners.size:
        reversal = np.min(np.abs(path[:, None] - corners[None, :]), axis=1)
    speed = plan.speed_m_per_s * (1.0 - 0.5 * np.exp(-((reversal / 0.03) ** 2)))
    time = np.concatenate([[0.0], np.cumsum(np.diff(path) / (0.5 * (speed[1:] + speed[:-1])))])
    turn = orthonormal(np.stack([np.broadcast_to(across(plan), axis.shape), axis, axis], axis=-1))
    opens = np.arange(trigger.size) % 2 == 0
    return Motion(time, tcp, turn, number, reversal, time[trigger], opens)


def _steps(tcp_m: np.ndarray) -> np.ndarray:
    return np.linalg.norm(np.diff(tcp_m, axis=0), axis=1)
