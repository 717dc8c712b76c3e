"""Draws believable jobs: a door, a bell that suits the index, and how each part is painted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .doors import Part, draw_door, flat_panel
from .jobs import Job, Motion, Plan, draw_plan, drive
from .parcels import Pattern, draw_pattern
from .truths import Truth

EXPERIMENTS = ('door', 'door_vertical', 'panel')


def stream(seed: int, purpose: int) -> np.random.Generator:
    """Random numbers of one purpose: changing one part of a job leaves the others alone."""
    return np.random.default_rng([purpose, seed])


def draw_jobs(
    seed: int, truths: list[Truth], experiments: tuple[str, ...], gun: str | None = None
) -> tuple[Pattern, list[Job]]:
    rng = stream(seed, 2)
    door = draw_door(rng)
    for truth in truths:
        door = truth.on_part(door)
        gun = truth.gun or gun
    usual_gun = rng.choice(['outside', 'near_edge'], p=[0.6, 0.4])
    gun = str(gun or usual_gun)
    vertical = 'door_vertical' not in experiments and rng.random() < 0.25
    both_ways = 'door_vertical' in experiments or vertical
    across = max(door.height_m, door.width_m) if both_ways else door.height_m
    index, half_width = _matched_index(rng, across)
    flow, film = solids_cm3_per_s(rng), rng.uniform(13.0, 28.0)
    pattern = draw_pattern(rng, half_width, flow)
    jobs, roll = [], None
    for name in experiments:
        own = stream(seed, 20 + EXPERIMENTS.index(name))
        if name == 'panel':
            part, direction = flat_panel(0.6, 2 * index + 0.7 * half_width), 'horizontal'
            plan = draw_plan(own, part, index, half_width, direction, 'outside')
            margin = 0.9 * half_width
            plan = replace(plan, passes=3, overrun_m=half_width, gun_margin_m=margin, follow=0.0)
        else:
            part = door
            direction = 'vertical' if name == 'door_vertical' or vertical else 'horizontal'
            plan = draw_plan(own, part, index, half_width, direction, gun)
        roll = plan.roll_rad if roll is None else roll
        plan = replace(plan, roll_rad=roll, speed_m_per_s=flow / (film * index))
        jobs.append(Job(name, part, *timed(part, plan, own)))
    return pattern, jobs


def _matched_index(rng: np.random.Generator, across_m: float) -> tuple[float, float]:
    """Index and SB50 that give a fair film: SB50 is about one, two or three indexes."""
    while True:
        index = rng.uniform(max(0.15, across_m / 5.4), 0.50)
        half_width = index * rng.choice([1, 2, 3], p=[0.4, 0.4, 0.2]) * rng.uniform(0.94, 1.06)
        if 0.25 <= half_width <= 0.58:
            return index, half_width


def solids_cm3_per_s(rng: np.random.Generator) -> float:
    """Deposited solids, cm^3/s: fluid flow x solids x transfer efficiency."""
    return rng.uniform(120.0, 300.0) / 60.0 * rng.uniform(0.35, 0.50) * rng.uniform(0.7, 0.9)


def brush_beside(pattern: Pattern, width: float) -> Pattern:
    """Another brush of the same bell: its width and flow times so much, and more in the middle."""
    shape = {'K2': pattern.K2 + 0.15, 'K3': 0.7 * pattern.K3}
    return replace(pattern.scaled(width), K1_cm3_per_s=width * pattern.K1_cm3_per_s, **shape)


def timed(part: Part, plan: Plan, rng: np.random.Generator) -> tuple[Plan, Motion]:
    """The motion, and the plan with a logging cycle that gives 1,000 to 3,000 poses."""
    motion = drive(part, plan, rng)
    cycle = (motion.time_s[-1] - motion.time_s[0]) / rng.uniform(1200.0, 2700.0)
    return replace(plan, sample_s=max(round(cycle / 0.004), 1) * 0.004), motion
