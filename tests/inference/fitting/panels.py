"""Panels that a model itself painted, as campaigns."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

import paint_deposition as pd
from paint_deposition.inference.fitting.study import TEXTURE_SHARE
from paint_deposition.inference.readings.campaign import Experiment
from paint_deposition.motion.path import SprayPath
from paint_deposition.motion.path_builder import spray_path
from scenes import painted

# A panel stands in x-z and looks to +y; the gun looks along -y with its x axis along x.
FACING = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
# Half a turn about the gun's axis.
HALF_TURN = np.array([0.0, np.sqrt(0.5), -np.sqrt(0.5), 0.0])
ORDERS = ((0.3, 1.1, 0.7, 1.5), (1.5, 0.7, 1.1, 0.3))


def panel_of(height_m: float, edge_m: float) -> pd.Surface:
    """A panel 0.8 m wide that stands on z = 0."""
    x, z = np.array([-0.4, 0.4, 0.4, -0.4]), np.array([0.0, 0.0, height_m, height_m])
    outline = np.stack([x, np.zeros(4), z], axis=1)
    return pd.Surface.from_triangles(outline, np.array([[0, 2, 1], [0, 3, 2]]), edge_m)


PANEL = panel_of(2.0, 0.2)


def passes(
    heights_m, speed_m_per_s=0.15, standoff_m=0.25, turned=False, samples=800
) -> pd.Trajectory:
    """To and fro along x at these heights, gun on between x = -1.2 and 1.2 m."""
    stamps, positions, quaternions, triggers = [], [], [], []
    duration, share = 2.4 / speed_m_per_s, np.linspace(0.0, 1.0, samples)
    for number, height in enumerate(heights_m):
        clock = number * (duration + 1.0)
        x = (1.0 if number % 2 == 0 else -1.0) * (-1.2 + 2.4 * share)
        stamps.append(clock + duration * share)
        positions.append(np.stack([x, np.full(samples, standoff_m), np.full(samples, height)], 1))
        turn = HALF_TURN if turned and number % 2 else FACING
        quaternions.append(np.tile(turn, (samples, 1)))
        triggers += [clock, clock + duration]
    return pd.Trajectory(
        np.round(np.concatenate(stamps) * 1e9).astype(np.int64), np.concatenate(positions),
        np.concatenate(quaternions), 'part', np.round(np.array(triggers) * 1e9).astype(np.int64),
        np.tile([1.0, 0.0], len(heights_m)),
    )  # fmt: skip


def column(low_m=0.1, high_m=1.9, count=40, x_m=0.0) -> np.ndarray:
    """(N, 3) points up the panel."""
    z = np.linspace(low_m, high_m, count)
    return np.stack([np.full(count, x_m), np.zeros(count), z], axis=1)


def grid_m(columns=5, rows=14, low_m=0.1, high_m=1.9) -> np.ndarray:
    """(N, 3) points over the panel."""
    x, z = np.meshgrid(np.linspace(-0.35, 0.35, columns), np.linspace(low_m, high_m, rows))
    return np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=1)


def readings_at(positions_m, film_um, noise_um=0.3, repeats=2, seed=0) -> pd.Readings:
    """Noisy readings, each point as often."""
    random = np.random.default_rng(seed)
    count = len(film_um)
    label = np.tile([f'P{k}' for k in range(count)], repeats)
    thickness = np.tile(film_um, repeats) + random.normal(0.0, noise_um, count * repeats)
    return pd.Readings.of(np.tile(positions_m, (repeats, 1)), thickness, point=label)


def painted_by(
    model: pd.DepositionModel, motion: pd.Trajectory | SprayPath, points_m: np.ndarray, *,
    surface: pd.Surface = PANEL, name: str = 'panel', texture: np.ndarray | float = 1.0, **noise,
) -> Experiment:  # fmt: skip
    """A panel that the model painted and a gauge measured, its film times a texture (N,)."""
    path = motion if isinstance(motion, SprayPath) else spray_path(motion)[0]
    film = painted(surface.at(points_m), path, model, 'double')
    readings = readings_at(points_m, film.gauge_um * texture, **noise)
    return Experiment.of(name, surface, path, readings)


def gauged(
    model: pd.DepositionModel, seed: int, columns: int = 3,
    orders: Sequence[Sequence[float]] = ORDERS[:1],
) -> pd.Campaign:  # fmt: skip
    """Panels painted in these orders of heights [m], with noise and texture as assumed."""
    points_m = grid_m(columns, 20, 0.03, 1.97)
    panels = []
    for number, heights_m in enumerate(orders):
        random = np.random.default_rng([seed, 1 + number])
        noise = {'noise_um': 0.7, 'seed': seed + 100 * number}
        noise |= {'texture': random.normal(1.0, TEXTURE_SHARE, len(points_m))}
        motion, name = passes(heights_m, samples=80), f'panel {number + 1}'
        panels.append(painted_by(model, motion, points_m, name=name, **noise))
    return pd.Campaign(tuple(panels))


def reading(part: Experiment, thickness_um: np.ndarray) -> Experiment:
    """The part as a gauge that shows this (N,) reads it."""
    return part.with_readings(replace(part.readings, thickness_um=thickness_um))
