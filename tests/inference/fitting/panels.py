"""Panels of the virtual paint shop as campaigns, and campaigns that the model itself painted."""

from collections.abc import Sequence

import numpy as np

from paint_deposition.effects.deposition_model import DepositionModel
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.inference.fitting.study import TEXTURE_SHARE
from paint_deposition.inference.readings.campaign import Campaign, Experiment
from paint_deposition.inference.readings.readings import Readings
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.motion.trajectory import Trajectory
from paint_deposition.part.surface import Surface
from virtual_paint_shop.shop import Campaign as Painted

# A panel stands in x-z and looks to +y; the gun looks along -y with its x axis along x.
FACING = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
OUTLINE_M = np.array([[-0.4, 0.0, 0.0], [0.4, 0.0, 0.0], [0.4, 0.0, 2.0], [-0.4, 0.0, 2.0]])
PANEL = Surface.from_triangles(OUTLINE_M, np.array([[0, 2, 1], [0, 3, 2]]), 0.2)


def campaign_of(painted: Painted) -> Campaign:
    """What the shop hands out, without what it hides."""
    experiments = []
    for one in painted.experiments:
        log, table = one.log, one.readings
        motion = Trajectory(
            log.stamps_ns, log.positions_m, log.quaternions_xyzw, 'part',
            log.trigger_stamps_ns, log.trigger_on.astype(float),
        )  # fmt: skip
        path, _ = spray_path(motion)
        surface = Surface.from_triangles(one.vertices_m, one.faces, 0.05)
        readings = Readings.of(
            table.positions_m, table.thickness_um, point=table.point, group=table.group
        )
        experiments.append(Experiment.of(one.name, surface, path, readings))
    return Campaign(tuple(experiments))


def passes(
    heights_m, speed_m_per_s=0.15, standoff_m=0.25, turned=False, samples=800
) -> Trajectory:
    """To and fro along x at these heights, gun on between x = -1.2 and 1.2 m."""
    stamps, positions, quaternions, triggers = [], [], [], []
    clock = 0.0
    # Half a turn about the gun's axis.
    half_turn = np.array([0.0, np.sqrt(0.5), -np.sqrt(0.5), 0.0])
    for number, height in enumerate(heights_m):
        share = np.linspace(0.0, 1.0, samples)
        way = 1.0 if number % 2 == 0 else -1.0
        x = way * (-1.2 + 2.4 * share)
        duration = 2.4 / speed_m_per_s
        stamps.append(clock + duration * share)
        positions.append(
            np.stack([x, np.full(samples, standoff_m), np.full(samples, float(height))], axis=1)
        )
        turn = half_turn if turned and number % 2 else FACING
        quaternions.append(np.tile(turn, (samples, 1)))
        triggers += [clock, clock + duration]
        clock += duration + 1.0
    return Trajectory(
        np.round(np.concatenate(stamps) * 1e9).astype(np.int64), np.concatenate(positions),
        np.concatenate(quaternions), 'part', np.round(np.array(triggers) * 1e9).astype(np.int64),
        np.tile([1.0, 0.0], len(heights_m)),
    )  # fmt: skip


def readings_at(positions_m, film_um, noise_um=0.3, repeats=2, seed=0) -> Readings:
    """Noisy readings, each point as often."""
    random = np.random.default_rng(seed)
    count = len(film_um)
    label = np.tile([f'P{k}' for k in range(count)], repeats)
    thickness = np.tile(film_um, repeats) + random.normal(0.0, noise_um, count * repeats)
    return Readings.of(np.tile(positions_m, (repeats, 1)), thickness, point=label)


def column(low_m=0.1, high_m=1.9, count=40, x_m=0.0) -> np.ndarray:
    """(N, 3) points up the panel."""
    z = np.linspace(low_m, high_m, count)
    return np.stack([np.full(count, x_m), np.zeros(count), z], axis=1)


def grid_m(columns=5, rows=14, low_m=0.1, high_m=1.9) -> np.ndarray:
    """(N, 3) points over the panel."""
    x, z = np.meshgrid(np.linspace(-0.35, 0.35, columns), np.linspace(low_m, high_m, rows))
    return np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=1)


ORDERS = ((0.3, 1.1, 0.7, 1.5), (1.5, 0.7, 1.1, 0.3))


def gauged(
    model: DepositionModel,
    seed: int,
    columns: int = 3,
    orders: Sequence[Sequence[float]] = ORDERS[:1],
) -> Campaign:
    """Panels painted by a model, two readings a point, with noise and texture as assumed.

    Args:
        seed: of noise and texture.
        columns: of readings.
        orders: heights of the passes on each panel, in their order [m].
    """
    points_m = grid_m(columns, 20, 0.03, 1.97)
    panels = []
    for number, heights_m in enumerate(orders):
        path, _ = spray_path(passes(heights_m, samples=80))
        integrator = FilmIntegrator(PANEL.at(points_m), model, 'double')
        integrator.add(path)
        random = np.random.default_rng([seed, 1 + number])
        film_um = integrator.gauge_um * random.normal(1.0, TEXTURE_SHARE, len(points_m))
        readings = readings_at(points_m, film_um, noise_um=0.7, seed=seed + 100 * number)
        panels.append(Experiment.of(f'panel {number + 1}', PANEL, path, readings))
    return Campaign(tuple(panels))


def painted_by(
    model: DepositionModel, motion: Trajectory, points_m: np.ndarray, **noise
) -> Experiment:
    """A panel that the model painted and a gauge measured."""
    path, _ = spray_path(motion)
    integrator = FilmIntegrator(PANEL.at(points_m), model, 'double')
    integrator.add(path)
    readings = readings_at(points_m, integrator.film_um, **noise)
    return Experiment.of('panel', PANEL, path, readings)
